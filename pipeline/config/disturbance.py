"""Configuration group `disturbance`: keys of what truth holds beyond the filter's model, and SI."""

import re
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

from omegaconf import MISSING

from inscal import units

if TYPE_CHECKING:
    from inscal.disturbance import Disturbance as Sizes

_G = units.STANDARD_GRAVITY

_UNITS: dict[str, float] = {
    "deg_per_h_per_sqrt_h": units.DEG_PER_HOUR / 60.0,
    "deg_per_h_per_g": units.DEG_PER_HOUR / _G,
    "deg_per_h": units.DEG_PER_HOUR,
    "ug_per_sqrt_h": units.MICRO_G / 60.0,
    "ug_per_g3": units.MICRO_G / _G**3,
    "ug_per_g2": units.MICRO_G / _G**2,
    "ug": units.MICRO_G,
    "ppm": units.PPM,
    "mm": units.MILLIMETRE,
    "ms": 1e-3,
    "arcsec": units.ARCSEC,
    "mgal": units.MILLIGAL,
    "percent": 0.01,
    "hz": 1.0,
    "m_per_s": 1.0,
    "s": 1.0,
    "factor": 1.0,
}
"""Endings of keys, the longer of two first, and the size of such a unit in SI."""

_OF = {"vibration_hz": "vibration_frequency"}
"""Sizes of the library that are not named as their keys."""


@dataclass
class Disturbance:
    """What truth holds beyond the filter's model; 0 is absent.

    Constants are drawn once a run, each component normal with mean zero and the value as sigma.

    Attributes
    ----------
    name : str
        Name of this choice.
    gyro_wander_deg_per_h, accel_wander_ug : float
        Sigma of a stationary first-order Gauss-Markov bias, per axis. Of a bias that wanders the
        truth is its constant part.
    gyro_wander_time_s, accel_wander_time_s : float
        Its correlation times.
    gyro_flicker_deg_per_h, accel_flicker_ug : float
        Bias instability: level of an Allan deviation that is flat from 10 s to 10 000 s.
    gyro_rate_random_walk_deg_per_h_per_sqrt_h, accel_random_walk_ug_per_sqrt_h : float
        Random walk of the bias, zero at the start.
    gyro_drift_deg_per_h, accel_drift_ug, gyro_scale_drift_ppm, accel_scale_drift_ppm : float
        Change from the start of the schedule to its end, of mean zero.
    drift_time_s : float
        Time constant of the drifts, a warm-up; 0: linear.
    off_axis_lever_arm_mm : float
        The six arms across the sensitive axes.
    table_offset_mm : float
        Unit off the table's centre, of which the observations are.
    gyro_accel_delay_ms, observation_delay_ms : float
        Accelerometers after gyros, observations after the time they are taken for.
    accel_asymmetry_ppm, gyro_asymmetry_ppm : float
        Scale factor of positive less that of negative input.
    accel_cubic_ug_per_g3, accel_cross_coupling_ug_per_g2, accel_pendulous_ug_per_g2 : float
        Of f_i^3, f_i f_j and f_j^2 on axis i.
    gyro_g_sensitivity_deg_per_h_per_g : float
        The nine entries of a matrix.
    gyro_quantisation_arcsec, accel_quantisation_m_per_s : float
        Size of a pulse; the remainder is carried.
    gravity_mgal, latitude_arcsec, deflection_arcsec : float
        True site less the believed one; the vertical's deflection to the north and to the east.
    turn_angle_arcsec, turn_rate_percent, table_axis_arcsec : float
        Angle of every turn; rate of all turns, up in their first half and down in their second;
        tilt of each axis of turning towards the others.
    base_tilt_arcsec : float
        Change of the table's tilt about north and east from start to end, linear.
    vibration_ug, vibration_hz : float
        Root mean square of the base's acceleration north, east and down, and its frequency.
    observation_correlation_time_s, observation_bias_m_per_s : float
        Of the observations' noise (0: white), and of the observed velocity.
    gyro_noise_factor, accel_noise_factor, velocity_noise_factor, position_noise_factor : float
        True noise over that of the group `noise`, which is the filter's; 1 is right.
    """

    name: str = MISSING
    gyro_wander_deg_per_h: float = MISSING
    gyro_wander_time_s: float = MISSING
    accel_wander_ug: float = MISSING
    accel_wander_time_s: float = MISSING
    gyro_flicker_deg_per_h: float = MISSING
    accel_flicker_ug: float = MISSING
    gyro_rate_random_walk_deg_per_h_per_sqrt_h: float = MISSING
    accel_random_walk_ug_per_sqrt_h: float = MISSING
    gyro_drift_deg_per_h: float = MISSING
    accel_drift_ug: float = MISSING
    gyro_scale_drift_ppm: float = MISSING
    accel_scale_drift_ppm: float = MISSING
    drift_time_s: float = MISSING
    off_axis_lever_arm_mm: float = MISSING
    table_offset_mm: float = MISSING
    gyro_accel_delay_ms: float = MISSING
    observation_delay_ms: float = MISSING
    accel_asymmetry_ppm: float = MISSING
    accel_cubic_ug_per_g3: float = MISSING
    accel_cross_coupling_ug_per_g2: float = MISSING
    accel_pendulous_ug_per_g2: float = MISSING
    gyro_asymmetry_ppm: float = MISSING
    gyro_g_sensitivity_deg_per_h_per_g: float = MISSING
    gyro_quantisation_arcsec: float = MISSING
    accel_quantisation_m_per_s: float = MISSING
    gravity_mgal: float = MISSING
    latitude_arcsec: float = MISSING
    deflection_arcsec: float = MISSING
    turn_angle_arcsec: float = MISSING
    turn_rate_percent: float = MISSING
    table_axis_arcsec: float = MISSING
    base_tilt_arcsec: float = MISSING
    vibration_ug: float = MISSING
    vibration_hz: float = MISSING
    observation_correlation_time_s: float = MISSING
    observation_bias_m_per_s: float = MISSING
    gyro_noise_factor: float = MISSING
    accel_noise_factor: float = MISSING
    velocity_noise_factor: float = MISSING
    position_noise_factor: float = MISSING


KEYS = tuple(field.name for field in fields(Disturbance) if field.name != "name")
"""Keys of sizes."""

NEEDED = {
    "gyro_wander_time_s": "gyro_wander_deg_per_h",
    "accel_wander_time_s": "accel_wander_ug",
    "vibration_hz": "vibration_ug",
}
"""Keys that must be above zero where another is."""

IDLE = ("drift_time_s", *NEEDED)
"""Keys that do nothing alone."""


@dataclass
class Believed:
    """What a filter believes of disturbances; keys, units and meaning are those of `Disturbance`.

    Sizes are the priors of the augmented states that ``estimator.states`` names, and nothing where
    it does not. Noise factors multiply the noise that the filter takes for true.
    """

    off_axis_lever_arm_mm: float = MISSING
    table_offset_mm: float = MISSING
    gyro_accel_delay_ms: float = MISSING
    accel_cubic_ug_per_g3: float = MISSING
    accel_asymmetry_ppm: float = MISSING
    accel_cross_coupling_ug_per_g2: float = MISSING
    accel_pendulous_ug_per_g2: float = MISSING
    gyro_asymmetry_ppm: float = MISSING
    gyro_g_sensitivity_deg_per_h_per_g: float = MISSING
    gyro_drift_deg_per_h: float = MISSING
    accel_drift_ug: float = MISSING
    gyro_scale_drift_ppm: float = MISSING
    accel_scale_drift_ppm: float = MISSING
    gravity_mgal: float = MISSING
    latitude_arcsec: float = MISSING
    deflection_arcsec: float = MISSING
    gyro_wander_deg_per_h: float = MISSING
    gyro_wander_time_s: float = MISSING
    accel_wander_ug: float = MISSING
    accel_wander_time_s: float = MISSING
    gyro_noise_factor: float = MISSING
    accel_noise_factor: float = MISSING


BELIEVED = tuple(field.name for field in fields(Believed))
"""Keys of what a filter may believe."""


def size_of(key: str) -> tuple[str, float]:
    """Field of `inscal.disturbance.Disturbance` that a key is of, and its unit in SI."""
    ending = next(ending for ending in _UNITS if key.endswith(f"_{ending}"))
    field = _OF.get(key, key if ending == "factor" else key.removesuffix(f"_{ending}"))
    return field, _UNITS[ending]


def sizes_of(group: Disturbance | Believed) -> "Sizes":
    """Sizes of a configuration group in SI."""
    from inscal.disturbance import Disturbance as Sizes

    values = {}
    for about in fields(group):
        if about.name != "name":
            field, unit = size_of(about.name)
            values[field] = getattr(group, about.name) * unit
    return Sizes(**values)


def key_of(source: str) -> str:
    """Key of the size of a source, a member of `inscal.disturbance.SOURCES`."""
    return next(key for key in KEYS if size_of(key)[0] == source)


def unit_text(key: str) -> str:
    """Unit that a key ends with, such as ``ug/g^3``."""
    ending = next(ending for ending in _UNITS if key.endswith(f"_{ending}"))
    powers = ending.replace("g2", "g^2").replace("g3", "g^3")
    roots = re.sub(r"_per_sqrt_(\w+)", r"/sqrt(\1)", powers)
    return roots.replace("_per_", "/")
