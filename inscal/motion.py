"""True motion along a schedule: what perfect inertial sensors integrate in every step.

The table turns the body about its centre, which stays at one point of the Earth. So the specific
force is minus gravity, constant in the navigation frame, and the body rate is the Earth's plus the
table's. In a steady turn both integrals are closed forms, and in a ramp, where the rate changes
linearly, a quadrature that is exact to rounding; no step size enters their accuracy.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from inscal import earth
from inscal.rotation import mean_rotation_of_ramp, ramp_terms
from inscal.schedule import Schedule, Segment, segments

MAX_LATITUDE = np.deg2rad(89.99)
"""Greatest latitude, rad. Estimates are right to 11 m from a pole and lost at 1 m."""


@dataclass(frozen=True)
class Site:
    """Where the table stands.

    Attributes
    ----------
    latitude : float
        Geodetic latitude, rad.
    height : float
        Height above the ellipsoid, m.

    Raises
    ------
    ValueError
        If it is within 1.1 km of a pole, where north is no direction to count on.
    """

    latitude: float
    height: float

    def __post_init__(self) -> None:
        if not abs(self.latitude) <= MAX_LATITUDE:
            raise ValueError(
                f"latitude of {np.rad2deg(self.latitude):g} deg: North, East, Down axes reach to "
                f"{np.rad2deg(MAX_LATITUDE):g} deg north and south"
            )

    @property
    def metres(self) -> np.ndarray:
        """Metres per unit of an offset in latitude, longitude (rad) and height (m), shape (3,)."""
        meridian, prime_vertical = earth.radii_of_curvature(np.sin(self.latitude))
        return np.array(
            [
                meridian + self.height,
                (prime_vertical + self.height) * np.cos(self.latitude),
                1.0,
            ]
        )


@dataclass(frozen=True)
class Motion:
    """True increments of a schedule, step by step.

    Attributes
    ----------
    duration : ndarray, shape (steps,)
        Length of each step, s.
    angle : ndarray, shape (steps, 3)
        Integral of the body rate relative to inertial space, in body axes, rad.
    velocity : ndarray, shape (steps, 3)
        Integral of the specific force, in body axes, m/s.
    ramp : ndarray, shape (steps,)
        Change of the table's rate within the step over twice its mean, kappa of `inscal.rotation`:
        as planned, so truth and filter know it alike. 0 at rest and in a steady turn.
    update_step : ndarray of int, shape (updates + 1,)
        Steps ``update_step[k]:update_step[k + 1]`` lead to update k.
    initial_attitude : ndarray, shape (3, 3)
        Body-to-NED matrix at the start.
    """

    duration: np.ndarray
    angle: np.ndarray
    velocity: np.ndarray
    ramp: np.ndarray
    update_step: np.ndarray
    initial_attitude: np.ndarray

    @property
    def steps(self) -> int:
        """Number of steps."""
        return len(self.duration)

    @cached_property
    def ramp_terms(self) -> np.ndarray:
        """What navigation needs to know of ramps: `inscal.rotation.ramp_terms` of `ramp`."""
        return ramp_terms(self.ramp)

    @property
    def updates(self) -> int:
        """Number of updates."""
        return len(self.update_step) - 1


def update_count(schedule: Schedule, update_interval: float) -> int:
    """Number of filter updates on a schedule.

    Raises
    ------
    ValueError
        If the schedule is not a whole number of update intervals long.
    """
    count = round(schedule.duration / update_interval)
    if count < 1 or abs(count * update_interval - schedule.duration) > 1e-6 * update_interval:
        raise ValueError(
            f"schedule of {schedule.duration:g} s is no multiple of updates, {update_interval:g} s"
        )
    return count


def cut(segment: Segment, update_interval: float) -> np.ndarray:
    """Times that cut a segment at the filter updates, its own ends included.

    Parameters
    ----------
    segment : Segment
    update_interval : float
        s.

    Returns
    -------
    ndarray, shape (pieces + 1,)
        Times since the start of the schedule, s.
    """
    tolerance = 1e-9
    first = np.floor(segment.start / update_interval + tolerance) + 1
    last = np.ceil(segment.end / update_interval - tolerance)
    inner = np.arange(first, last) * update_interval
    return np.concatenate([[segment.start], inner, [segment.end]])


def update_of(edges: np.ndarray, update_interval: float) -> np.ndarray:
    """Number of the update that each piece between two `edges` leads to."""
    middle = 0.5 * (edges[:-1] + edges[1:])
    return np.floor(middle / update_interval).astype(np.int64)


def attitude_at(segment: Segment, times: np.ndarray) -> np.ndarray:
    """Body-to-NED matrices at times within a segment, shape (len(times), 3, 3)."""
    if not segment.is_turn:
        return np.broadcast_to(segment.attitude, (len(times), 3, 3))
    turned = Rotation.from_rotvec(segment.turned_at(times))
    return segment.attitude @ turned.as_matrix()


@dataclass(frozen=True)
class Steps:
    """A schedule cut into steps: the table rests, turns steadily, or changes its rate linearly.

    Attributes
    ----------
    duration : ndarray, shape (steps,)
        s.
    attitude : ndarray, shape (steps, 3, 3)
        Body-to-NED matrix at the start of each step.
    rate : ndarray, shape (steps, 3)
        Of the table, its mean over the step, in body axes, rad/s.
    ramp : ndarray, shape (steps,)
        As of `Motion`: the rate goes from ``rate * (1 - ramp)`` to ``rate * (1 + ramp)``.
    to_body : ndarray, shape (steps, 3, 3)
        Integral of the NED-to-body matrix over each step, s.
    turn : ndarray of int, shape (steps,)
        Number of the turn that a step is of; -1 at rest.
    update_step : ndarray of int, shape (updates + 1,)
        As of `Motion`.
    """

    duration: np.ndarray
    attitude: np.ndarray
    rate: np.ndarray
    ramp: np.ndarray
    to_body: np.ndarray
    turn: np.ndarray
    update_step: np.ndarray


def cut_into_steps(
    schedule: Schedule, *, update_interval: float, dwell_step: float, turn_step: float
) -> Steps:
    """Cut a schedule into the steps of a simulation.

    Steps end at update times and where a turn or a ramp begins or ends; between those a stretch is
    cut into the fewest equal steps no longer than `dwell_step` or `turn_step`.

    Parameters
    ----------
    schedule : Schedule
    update_interval, dwell_step, turn_step : float
        s.

    Returns
    -------
    Steps

    Raises
    ------
    ValueError
        If the schedule is not a whole number of update intervals long, or a turn does not fit.
    """
    return steps_of(
        segments(schedule),
        update_count(schedule, update_interval),
        update_interval=update_interval,
        dwell_step=dwell_step,
        turn_step=turn_step,
    )


def steps_of(
    parts: Iterable[Segment],
    updates: int,
    *,
    update_interval: float,
    dwell_step: float,
    turn_step: float,
) -> Steps:
    """Cut a stretch that begins with an update interval into steps, as `cut_into_steps` does.

    Parameters
    ----------
    parts : iterable of Segment
    updates : int
        Of the stretch.
    update_interval, dwell_step, turn_step : float
        s.

    Returns
    -------
    Steps
    """
    steps_of_update = np.zeros(updates, dtype=np.int64)
    durations, attitudes, rates, ramps, turns = [], [], [], [], []
    for segment in parts:
        longest = turn_step if segment.is_turn else dwell_step
        edges = cut(segment, update_interval)
        length = np.diff(edges)
        count = np.maximum(1, np.ceil(length / longest - 1e-6)).astype(np.int64)
        np.add.at(steps_of_update, update_of(edges, update_interval), count)
        step = np.repeat(length / count, count)
        within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        start = np.repeat(edges[:-1], count) + within * step
        durations.append(step)
        attitudes.append(attitude_at(segment, start))
        mean, ramp = _rates(segment, start, step)
        rates.append(mean)
        ramps.append(ramp)
        turns.append(np.full(len(step), segment.turn))
    duration, rate, ramp, attitude = map(np.concatenate, (durations, rates, ramps, attitudes))
    # J(-turn) transposes the start attitude
    to_body = mean_rotation_of_ramp(-rate * duration[:, None], ramp) @ attitude.mT
    to_body *= duration[:, None, None]
    return Steps(
        duration=duration,
        attitude=attitude,
        rate=rate,
        ramp=ramp,
        to_body=to_body,
        turn=np.concatenate(turns),
        update_step=np.concatenate([[0], np.cumsum(steps_of_update)]),
    )


def _rates(
    segment: Segment, start: np.ndarray, duration: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean rates of steps within a segment, shape (steps, 3), and their ramps, (steps,)."""
    if not segment.is_ramp:
        return np.broadcast_to(segment.rate, (len(start), 3)), np.zeros(len(start))
    mean = segment.rate_at(start + 0.5 * duration)
    along = segment.acceleration / np.linalg.norm(segment.acceleration)
    change = 0.5 * duration * (segment.acceleration @ along)
    return mean, change / (mean @ along)


def build_motion(
    schedule: Schedule, site: Site, *, update_interval: float, dwell_step: float, turn_step: float
) -> Motion:
    """True increments of a perfect sensor along a schedule.

    Parameters
    ----------
    schedule : Schedule
    site : Site
    update_interval, dwell_step, turn_step : float
        As of `cut_into_steps`, s.

    Returns
    -------
    Motion

    Raises
    ------
    ValueError
        If the schedule is not a whole number of update intervals long, or a turn does not fit.
    """
    steps = cut_into_steps(
        schedule, update_interval=update_interval, dwell_step=dwell_step, turn_step=turn_step
    )
    return motion_of(steps, site)


def motion_of(steps: Steps, site: Site) -> Motion:
    """True increments of a perfect sensor in some steps."""
    turned = steps.rate * steps.duration[:, None]
    return Motion(
        duration=steps.duration,
        angle=turned + steps.to_body @ earth.earth_rate_ned(site.latitude),
        velocity=steps.to_body @ -earth.gravity_ned(site.latitude, site.height),
        ramp=steps.ramp,
        update_step=steps.update_step,
        initial_attitude=steps.attitude[0],
    )
