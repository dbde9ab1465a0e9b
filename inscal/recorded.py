r"""Recorded increments of one unit: rests and turns found in them, alignment, and steps of a path.

A record of a laboratory has no schedule that could be believed to the second. What gains and
disturbances need to know of the motion, the attitude of the body and its rate, follows from the
increments themselves: the attitude at the start from gravity and the Earth's rate in the first
rest (the triad method of Black, A passive system for determining the attitude of a satellite, AIAA
Journal 2, 1964), and what follows by adding up the gyros' turns. That is right to the sensors'
own errors, a milliradian after an hour for errors of 0.1 deg/h and 30 ppm, which gains do not
feel; once there are estimates, compensated increments make it better.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.ndimage import maximum_filter1d, uniform_filter1d
from scipy.spatial.transform import Rotation

from inscal import earth
from inscal.kernel import compiled
from inscal.motion import Site, Steps
from inscal.path import Path
from inscal.sensor import matrices

WINDOW = 0.5
"""Time over which rates are averaged to tell a turn from a rest, s."""
_LEAST_RATE = np.deg2rad(0.3)  # of a turn, rad/s
_NOISES = 8.0  # or so many times the scatter of the means at rest
_SHORTEST_TURN = 0.3  # s
_MARGIN = 1.0  # s, by which turns are longer than their rate shows: tables settle
_SHORTEST_REST = 2.0  # s: less between two turns is part of one


@dataclass(frozen=True)
class Increments:
    """What sensors reported, sample by sample.

    Attributes
    ----------
    interval : float
        Of a sample, s.
    angle : ndarray, shape (samples, 3)
        Angle increments in body axes, right-handed, rad.
    velocity : ndarray, shape (samples, 3)
        Velocity increments, m/s; upwards at rest.
    observed : ndarray, shape (samples, 6), or None
        Velocity (m/s) and offset from the site (m), North, East and Down, at the end of each sample
        that ends an update interval; others are not used. None: both are known to be zero.
    """

    interval: float
    angle: np.ndarray
    velocity: np.ndarray
    observed: np.ndarray | None = None

    @property
    def duration(self) -> float:
        """Of the record, s."""
        return len(self.angle) * self.interval

    def part(self, first: int, end: int) -> "Increments":
        """Samples from `first` to the one before `end`."""
        seen = None if self.observed is None else self.observed[first:end]
        return Increments(self.interval, self.angle[first:end], self.velocity[first:end], seen)


@dataclass(frozen=True)
class Stretch:
    """Samples during which the body rests, or turns.

    Attributes
    ----------
    first, end : int
        First sample, and the one behind the last.
    turns : bool
    """

    first: int
    end: int
    turns: bool


def stretches(record: Increments) -> list[Stretch]:
    """Rests and turns of a record, in order of time.

    Parameters
    ----------
    record : Increments

    Returns
    -------
    list of Stretch
        They alternate, and cover the record.

    Raises
    ------
    ValueError
        If there is no rest.
    """
    window = max(1, round(WINDOW / record.interval))
    rate = uniform_filter1d(record.angle / record.interval, window, axis=0, mode="nearest")
    still = np.median(rate, axis=0)
    away = np.linalg.norm(rate - still, axis=1)
    for _ in range(2):  # the middle of all is not yet that of the rests where much is turned
        quiet = away <= np.quantile(away, 0.5)
        still = np.median(rate[quiet], axis=0)
        away = np.linalg.norm(rate - still, axis=1)
    scatter = np.sqrt(np.mean(np.square(away[away <= np.quantile(away, 0.5)])))
    turns = away > max(_LEAST_RATE, _NOISES * scatter)
    turns = _without_short(turns, False, round(_SHORTEST_REST / record.interval))
    turns = _without_short(turns, True, round(_SHORTEST_TURN / record.interval))
    margin = 2 * round(_MARGIN / record.interval) + 1
    turns = maximum_filter1d(turns.astype(np.int8), margin).astype(bool)
    edges = np.flatnonzero(np.diff(turns)) + 1
    bounds = [0, *edges.tolist(), len(turns)]
    if turns.all():
        raise ValueError("the record has no rest")
    return [Stretch(first, end, bool(turns[first])) for first, end in itertools.pairwise(bounds)]


def _without_short(turns: np.ndarray, kind: bool, least: int) -> np.ndarray:
    """Flags in which short runs of one kind, but for those at the ends, are of the other."""
    bounds = np.flatnonzero(np.diff(turns, prepend=~turns[0], append=~turns[-1]))
    out = turns.copy()
    for first, end in itertools.pairwise(bounds):
        inside = first > 0 and end < len(turns)
        if turns[first] == kind and end - first < least and inside:
            out[first:end] = not kind
    return out


def aligned(record: Increments, rest: Stretch, site: Site) -> np.ndarray:
    """Body-to-NED matrix in a rest, from gravity and the Earth's rate.

    Parameters
    ----------
    record : Increments
    rest : Stretch
    site : Site

    Returns
    -------
    ndarray, shape (3, 3)
    """
    up = record.velocity[rest.first : rest.end].mean(axis=0)
    spin = record.angle[rest.first : rest.end].mean(axis=0)
    body = _triad(-up, spin)
    ned = _triad(earth.gravity_ned(site.latitude, site.height), earth.earth_rate_ned(site.latitude))
    return np.asarray(ned @ body.T)


def _triad(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Right-handed axes of two vectors, as columns, the first exact."""
    x = first / np.linalg.norm(first)
    y = np.cross(x, second)
    y /= np.linalg.norm(y)
    return np.stack([x, y, np.cross(x, y)], axis=1)


def compensated(record: Increments, parameters: np.ndarray) -> Increments:
    """Increments corrected by biases and matrices, which is all that rests and turns are found by.

    Parameters
    ----------
    record : Increments
    parameters : ndarray, shape (27,)
        SI.

    Returns
    -------
    Increments
    """
    gyro, accel = np.eye(3) + matrices(parameters[:, None])[:, 0]
    angle, velocity = record.angle @ gyro.T, record.velocity @ accel.T
    angle += parameters[0:3] * record.interval
    velocity += parameters[3:6] * record.interval
    return replace(record, angle=angle, velocity=velocity)


def whole_updates(record: Increments, update_interval: float) -> Increments:
    """The record up to its last whole update.

    Raises
    ------
    ValueError
        If an update interval is no whole number of samples, or longer than the record.
    """
    samples = round(update_interval / record.interval)
    if samples < 1 or abs(samples * record.interval - update_interval) > 1e-6 * update_interval:
        raise ValueError(
            f"an update interval of {update_interval:g} s is no whole number of samples of "
            f"{record.interval:g} s"
        )
    count = len(record.angle) // samples * samples
    if count == 0:
        raise ValueError(f"the record is shorter than an update interval, {update_interval:g} s")
    return record.part(0, count)


def coarser(
    record: Increments, parts: Sequence[Stretch], update_interval: float, longest: float
) -> tuple[Increments, list[Stretch]]:
    """A record in longer samples, for effects that need to know turns only roughly.

    Parameters
    ----------
    record : Increments
        A whole number of updates long.
    parts : sequence of Stretch
        Of the record.
    update_interval : float
        s.
    longest : float
        Sample, s; at most so long, and a part of an update.

    Returns
    -------
    record : Increments
        Without observations.
    parts : list of Stretch
    """
    samples = round(update_interval / record.interval)
    most = max(1, int(longest / record.interval + 1e-9))
    count = max(n for n in range(1, most + 1) if samples % n == 0)
    angle, velocity = (x.reshape(-1, count, 3).sum(axis=1) for x in (record.angle, record.velocity))
    cut = [Stretch(one.first // count, one.end // count, one.turns) for one in parts]
    return Increments(record.interval * count, angle, velocity), cut


def first_samples(parts: Sequence[Stretch], samples: int) -> np.ndarray:
    """First sample of every step: a rest is cut at updates alone, a turn at every sample.

    Parameters
    ----------
    parts : sequence of Stretch
    samples : int
        Of an update interval.

    Returns
    -------
    ndarray of int, shape (steps,)
    """
    begins = []
    for part in parts:
        if part.turns:
            begins.append(np.arange(part.first, part.end))
        else:
            updates = np.arange(-(-part.first // samples) * samples, part.end, samples)
            begins.append(np.unique(np.concatenate([[part.first], updates])))
    return np.concatenate(begins)


def steps_of_record(
    record: Increments,
    parts: Sequence[Stretch],
    attitude: np.ndarray,
    site: Site,
    update_interval: float,
) -> tuple[Steps, np.ndarray]:
    """Steps of the path that a record shows.

    Parameters
    ----------
    record : Increments
        A whole number of updates long; the better compensated, the better the steps.
    parts : sequence of Stretch
        Of the record.
    attitude : ndarray, shape (3, 3)
        Body to NED at the start.
    site : Site
    update_interval : float
        s.

    Returns
    -------
    steps : Steps
    first : ndarray of int, shape (steps,)
        First sample of each.
    """
    samples = round(update_interval / record.interval)
    first = first_samples(parts, samples)
    duration = np.diff(first, append=len(record.angle)) * record.interval
    turned = np.add.reduceat(record.angle, first, axis=0)
    spin = earth.earth_rate_ned(site.latitude)
    starts, middles = np.empty((2, len(first), 3, 3))
    of_earth = Rotation.from_rotvec(-0.5 * duration[:, None] * spin).as_matrix()
    half = Rotation.from_rotvec(0.5 * turned).as_matrix()
    _add_up(np.ascontiguousarray(attitude), of_earth, half, starts, middles)
    to_body = middles.mT * duration[:, None, None]
    rate = (turned - to_body @ spin) / duration[:, None]
    turn = np.full(len(first), -1)
    for number, part in enumerate(part for part in parts if part.turns):
        turn[np.searchsorted(first, part.first) : np.searchsorted(first, part.end)] = number
    rate[turn < 0] = 0.0
    steps = Steps(
        duration=duration,
        attitude=starts,
        rate=rate,
        ramp=np.zeros(len(first)),
        to_body=to_body,
        turn=turn,
        update_step=np.searchsorted(first, np.arange(0, len(record.angle) + 1, samples)),
    )
    return steps, first


class RecordedPath(Path):
    """A path whose rate changes from step to step as recorded, and never at once."""

    @cached_property
    def edge_rates(self) -> tuple[np.ndarray, np.ndarray]:
        """Rate at the start and at the end of each step, rad/s: the mean of those on both sides."""
        edges = 0.5 * (
            np.pad(self.steps.rate, ((1, 0), (0, 0))) + np.pad(self.steps.rate, ((0, 1), (0, 0)))
        )
        return edges[:-1], edges[1:]

    @cached_property
    def jumps(self) -> tuple[np.ndarray, np.ndarray]:
        """None: zeros of shape (steps, 3), twice."""
        none = np.zeros_like(self.steps.rate)
        return none, none


def turned_between(
    angle: np.ndarray, bounds: np.ndarray, matrix: np.ndarray, bias: np.ndarray
) -> np.ndarray:
    """Rotations of turns, added up from compensated increments of gyros.

    Parameters
    ----------
    angle : ndarray, shape (samples, 3)
        Reported, rad.
    bounds : ndarray of int, shape (turns, 2)
        First sample of each, and the one behind its last.
    matrix : ndarray, shape (3, 3)
    bias : ndarray, shape (3,)
        Increments are compensated by ``matrix @ angle + bias``, rad.

    Returns
    -------
    ndarray, shape (turns, 3, 3)
        Body axes at the end to body axes at the start.
    """
    out = np.empty((len(bounds), 3, 3))
    _turn(np.ascontiguousarray(angle), bounds, matrix, bias, out)
    return out


@compiled
def _turn(angle, bounds, matrix, bias, out):
    """Fill `out`; increments are so small that the rotation's series ends with its fourth term."""
    for t in range(len(bounds)):
        now = np.eye(3)
        for k in range(bounds[t, 0], bounds[t, 1]):
            x = matrix @ angle[k] + bias
            square = (x**2).sum()
            cross = np.array([[0.0, -x[2], x[1]], [x[2], 0.0, -x[0]], [-x[1], x[0], 0.0]])
            once, twice = 1.0 - square / 6.0, 0.5 - square / 24.0
            now = now @ (np.eye(3) + once * cross + twice * cross @ cross)
        out[t] = now


@compiled
def _add_up(attitude, of_earth, half, starts, middles):
    """Attitudes at the start and in the middle of steps, which turn by `half` twice."""
    now = attitude.copy()
    for k in range(len(half)):
        starts[k] = now
        middles[k] = of_earth[k] @ now @ half[k]
        now = of_earth[k] @ middles[k] @ half[k]
