"""What a truth holds beyond the filter's model: sizes, constants drawn from them, their streams.

Every size is zero unless given, and what is zero is left out altogether. Three kinds:

- **Constants** are drawn once per run, each component normal with mean zero and the size as its
  sigma (`COMPONENTS`). What one unit of a component does to a record: `inscal.unit_effects`.
- **Processes** wander during a run; their state space is in `inscal.wander`.
- The rest is no draw: noise factors, pulses, correlation of the observations.

Sensor terms stand on the side of the model where the 27 parameters stand: the amount that a
compensation would have to add. So a positive one makes the reading smaller. A parameter's truth is
its constant part: what wanders or drifts about it is no part of the truth that errors are taken
from.

Each source of each run has a stream of its own, named by the campaign's seed, the run and the
source's place in `SOURCES`. So no other draw changes with a disturbance, and campaigns with and
without one are paired run by run.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

PURPOSE = 4
"""Follows those of `inscal.simulation.PURPOSES`."""

COMPONENTS: dict[str, int] = {
    "gyro_drift": 3,
    "accel_drift": 3,
    "gyro_scale_drift": 3,
    "accel_scale_drift": 3,
    "off_axis_lever_arm": 6,
    "table_offset": 3,
    "gyro_accel_delay": 1,
    "observation_delay": 1,
    "accel_asymmetry": 3,
    "accel_cubic": 3,
    "accel_cross_coupling": 6,
    "accel_pendulous": 6,
    "gyro_asymmetry": 3,
    "gyro_g_sensitivity": 9,
    "gravity": 1,
    "latitude": 1,
    "deflection": 2,
    "turn_angle": 0,
    "turn_rate": 1,
    "table_axis": 6,
    "base_tilt": 2,
    "vibration": 6,
    "observation_bias": 3,
}
"""Constants per run of each source; of ``turn_angle`` there is one per turn."""

PROCESSES = (
    *("gyro_wander", "accel_wander", "gyro_flicker", "accel_flicker"),
    *("gyro_rate_random_walk", "accel_random_walk"),
)
"""Sources that wander during a run, on three axes each."""

SOURCES = (*COMPONENTS, *PROCESSES)
"""In the order of their streams: append only, or the draws of others change."""


_NEEDS = {
    "gyro_wander": "gyro_wander_time",
    "accel_wander": "accel_wander_time",
    "vibration": "vibration_frequency",
}


@dataclass(frozen=True)
class Disturbance:
    """Sizes of all disturbances, SI; zero is absent.

    Attributes
    ----------
    gyro_wander, accel_wander : float
        Standard deviation of a stationary first-order Gauss-Markov bias, rad/s and m/s^2.
    gyro_wander_time, accel_wander_time : float
        Its correlation times, s.
    gyro_flicker, accel_flicker : float
        Level of the flat Allan deviation of the bias, rad/s and m/s^2.
    gyro_rate_random_walk, accel_random_walk : float
        Random walk of the bias, rad/s/sqrt(s) and m/s^2/sqrt(s); zero at the start.
    gyro_drift, accel_drift : float
        Change of the bias from start to end, rad/s and m/s^2; its mean over the path is zero.
    gyro_scale_drift, accel_scale_drift : float
        The same of the scale factors, 1.
    drift_time : float
        Drifts are exponential with this time constant, s; 0: linear.
    off_axis_lever_arm : float
        Arms of each accelerometer across its axis, m.
    table_offset : float
        Place of the unit off the table's centre, m, in body axes.
    gyro_accel_delay, observation_delay : float
        Accelerometers after gyros, observations after the time they are taken for, s.
    accel_asymmetry, gyro_asymmetry : float
        Scale factor of positive less that of negative input, 1.
    accel_cubic : float
        s^4/m^2.
    accel_cross_coupling, accel_pendulous : float
        Of f_i f_j and f_j^2 on axis i, s^2/m.
    gyro_g_sensitivity : float
        Entries of a 3 by 3 matrix, rad/s per m/s^2.
    gyro_quantisation, accel_quantisation : float
        Pulses, rad and m/s.
    gravity : float
        True less believed gravity, m/s^2.
    latitude : float
        True less believed latitude, rad.
    deflection : float
        Deflection of the vertical north and east, rad.
    turn_angle : float
        Of each turn, rad.
    turn_rate : float
        Share by which all turns are faster in their first half and slower in their second, 1.
    table_axis : float
        Tilt of the axis of turns about x, y and z towards the two others, rad.
    base_tilt : float
        Change of the base's tilt about North and East over the path, rad.
    vibration : float
        Root mean square of the base's horizontal and vertical acceleration, m/s^2 each.
    vibration_frequency : float
        Hz.
    observation_correlation_time : float
        Of the observations' noise, s; 0: white.
    observation_bias : float
        Of the observed velocity, m/s.
    gyro_noise_factor, accel_noise_factor, velocity_noise_factor, position_noise_factor : float
        True noise over that of the noise model; 1 is right.
    """

    gyro_wander: float = 0.0
    gyro_wander_time: float = 0.0
    accel_wander: float = 0.0
    accel_wander_time: float = 0.0
    gyro_flicker: float = 0.0
    accel_flicker: float = 0.0
    gyro_rate_random_walk: float = 0.0
    accel_random_walk: float = 0.0
    gyro_drift: float = 0.0
    accel_drift: float = 0.0
    gyro_scale_drift: float = 0.0
    accel_scale_drift: float = 0.0
    drift_time: float = 0.0
    off_axis_lever_arm: float = 0.0
    table_offset: float = 0.0
    gyro_accel_delay: float = 0.0
    observation_delay: float = 0.0
    accel_asymmetry: float = 0.0
    accel_cubic: float = 0.0
    accel_cross_coupling: float = 0.0
    accel_pendulous: float = 0.0
    gyro_asymmetry: float = 0.0
    gyro_g_sensitivity: float = 0.0
    gyro_quantisation: float = 0.0
    accel_quantisation: float = 0.0
    gravity: float = 0.0
    latitude: float = 0.0
    deflection: float = 0.0
    turn_angle: float = 0.0
    turn_rate: float = 0.0
    table_axis: float = 0.0
    base_tilt: float = 0.0
    vibration: float = 0.0
    vibration_frequency: float = 0.0
    observation_correlation_time: float = 0.0
    observation_bias: float = 0.0
    gyro_noise_factor: float = 1.0
    accel_noise_factor: float = 1.0
    velocity_noise_factor: float = 1.0
    position_noise_factor: float = 1.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not 0.0 <= value < np.inf:
                raise ValueError(f"{field.name} of {value:g}: must be a finite number >= 0")
        for size, needed in _NEEDS.items():
            if getattr(self, size) > 0.0 and getattr(self, needed) == 0.0:
                raise ValueError(f"{size} needs a {needed} above zero")

    @property
    def absent(self) -> bool:
        """Whether nothing is disturbed but the size of the noise."""
        further = self.gyro_quantisation, self.accel_quantisation, self.observation_correlation_time
        return not (self.constants or self.processes or any(further))

    @property
    def constants(self) -> list[str]:
        """Sources present that draw constants, keys of `COMPONENTS`."""
        return [name for name in COMPONENTS if getattr(self, name) > 0.0]

    @property
    def processes(self) -> list[str]:
        """Sources present that wander, members of `PROCESSES`."""
        return [name for name in PROCESSES if getattr(self, name) > 0.0]


NOTHING = Disturbance()
"""No disturbance at all."""


def stream(seed: int, run: int, source: str) -> np.random.Generator:
    """Random stream of one source in one run.

    Parameters
    ----------
    seed : int
        The campaign's.
    run : int
    source : str
        Member of `SOURCES`.

    Returns
    -------
    numpy.random.Generator
    """
    key = (run, PURPOSE, SOURCES.index(source))
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence(seed, spawn_key=key)))


def draw_constants(
    disturbance: Disturbance, source: str, turns: int, *, seed: int, runs: Sequence[int]
) -> np.ndarray:
    """Constants of a source in some runs.

    Parameters
    ----------
    disturbance : Disturbance
    source : str
        Key of `COMPONENTS`.
    turns : int
        Of the schedule.
    seed : int
        The campaign's.
    runs : sequence of int

    Returns
    -------
    ndarray, shape (components, runs)
        SI.
    """
    count = COMPONENTS[source] or turns
    draws = [stream(seed, run, source).standard_normal(count) for run in runs]
    return getattr(disturbance, source) * np.array(draws).T
