"""What the wing adds to the configuration: ``conf/paper.yaml``, its classes and its rules."""

from dataclasses import dataclass, field
from functools import partial

from omegaconf import MISSING

from pipeline.config.load import Program
from pipeline.config.rule import (
    COUNT,
    FINITE,
    MOST_PASSES,
    POSITIVE,
    TRIPLE_OF_POSITIVE,
    one_of,
    several,
)
from pipeline.config.schema import Config
from pipeline.config.stage import stage as _stage


@dataclass
class Effects:
    """Effect studies: one sensor error alone, in three environments.

    Attributes
    ----------
    quadratic_1e_9, lever_arm_mm : float
        The sensor errors, of the accelerometer that points north.
    duration_s : float
        Time navigated, from rest.
    static_step_s : float
        Length of the increments of a body at rest.
    vibration_rms_g, vibration_frequency_hz, vibration_rate_hz : float
        Sinusoidal acceleration along the x axis, and the rate of the sensors that feel it.
    swing_amplitude_deg, swing_frequency_hz, swing_rate_hz : float
        Sinusoidal swing, and the rate of the sensors that feel it.
    swing_axis : str
        Body axis of the swing, X, Y or Z.
    """

    quadratic_1e_9: float = MISSING
    lever_arm_mm: float = MISSING
    duration_s: float = MISSING
    static_step_s: float = MISSING
    vibration_rms_g: float = MISSING
    vibration_frequency_hz: float = MISSING
    vibration_rate_hz: float = MISSING
    swing_amplitude_deg: float = MISSING
    swing_frequency_hz: float = MISSING
    swing_axis: str = MISSING
    swing_rate_hz: float = MISSING


@dataclass
class Laboratory:
    """The laboratory experiment as a virtual one.

    Attributes
    ----------
    coarse_gyro_scale_factor_ppm, coarse_accel_pulses_per_m_per_s : list of 3 float
        Scale factors known before the calibration, applied to what the sensors give.
    runs : int
        Experiments with other noise.
    residual_scale_factors_ppm : list of float
        Errors left by coarser scale factors, swept.
    residual_passes : list of int
        Most passes tried for each of them.
    """

    coarse_gyro_scale_factor_ppm: list[float] = MISSING
    coarse_accel_pulses_per_m_per_s: list[float] = MISSING
    runs: int = MISSING
    residual_scale_factors_ppm: list[float] = MISSING
    residual_passes: list[int] = MISSING


@dataclass
class PaperConfig(Config):
    """The product's configuration and what the paper's other experiments need.

    Attributes
    ----------
    effects, laboratory : object
        The groups of ``conf/paper.yaml``.
    """

    effects: Effects = field(default_factory=Effects)
    laboratory: Laboratory = field(default_factory=Laboratory)


PROGRAM = Program(
    "paper",
    PaperConfig,
    {
        "effects.quadratic_1e_9": FINITE,
        "effects.lever_arm_mm": FINITE,
        "effects.duration_s": POSITIVE,
        "effects.static_step_s": POSITIVE,
        "effects.vibration_rms_g": POSITIVE,
        "effects.vibration_frequency_hz": POSITIVE,
        "effects.vibration_rate_hz": POSITIVE,
        "effects.swing_amplitude_deg": POSITIVE,
        "effects.swing_frequency_hz": POSITIVE,
        "effects.swing_axis": one_of("X", "Y", "Z"),
        "effects.swing_rate_hz": POSITIVE,
        "laboratory.coarse_gyro_scale_factor_ppm": TRIPLE_OF_POSITIVE,
        "laboratory.coarse_accel_pulses_per_m_per_s": TRIPLE_OF_POSITIVE,
        "laboratory.runs": COUNT,
        "laboratory.residual_scale_factors_ppm": several(POSITIVE),
        "laboratory.residual_passes": several(MOST_PASSES),
    },
)
"""What a stage of the wing reads."""

stage = partial(_stage, program=PROGRAM)
"""Runner of the wing's stages."""
