"""Groups of the configuration that no campaign's numbers depend on.

Where runs are computed, and what the reproductions of the paper's other experiments need.
"""

from dataclasses import dataclass

from omegaconf import MISSING


@dataclass
class Cluster:
    """Where batches are computed; what a kind does not use is None.

    Attributes
    ----------
    kind : str
        ``threads``, ``processes``, ``scheduler`` or ``slurm``.
    workers : int or None
        Number of threads, processes or SLURM jobs.
    address : str or None
        Address of a running scheduler.
    queue, memory, walltime, account : str or None
        What a SLURM job asks for; the account may be left out.
    cores : int or None
        Threads of a SLURM job.
    """

    kind: str = MISSING
    workers: int | None = None
    address: str | None = None
    queue: str | None = None
    cores: int | None = None
    memory: str | None = None
    walltime: str | None = None
    account: str | None = None


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
        Numbers of passes tried for each of them.
    """

    coarse_gyro_scale_factor_ppm: list[float] = MISSING
    coarse_accel_pulses_per_m_per_s: list[float] = MISSING
    runs: int = MISSING
    residual_scale_factors_ppm: list[float] = MISSING
    residual_passes: list[int] = MISSING
