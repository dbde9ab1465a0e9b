"""Calibration schedules: a list of turns, and the postures and motion segments they lead to.

A schedule starts in a posture (the directions in which the body axes point), dwells, turns about a
body axis, dwells again, and so on. A position's time is that of its dwell and of the turn that ends
it; the last one only dwells (paper section 4, Table 1, where all last equally long). The rate of a
turn is that of `inscal.profile`.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from inscal.directions import AXES, DIRECTIONS
from inscal.profile import Profile, profile_of
from inscal.units import DEGREE


@dataclass(frozen=True)
class Turn:
    """One rotation of the table about a body axis.

    Attributes
    ----------
    angle : float
        Right-handed angle, rad; negative turns the other way.
    axis : int
        Body axis, 0, 1 or 2 for x, y or z.
    duration : float or None
        Of the position that it ends, s; None: as long as others.
    rate : float or None
        Highest rate, rad/s; None: that of the other turns.
    """

    angle: float
    axis: int
    duration: float | None = None
    rate: float | None = None


def turns_of(rotations: Iterable[Sequence[Any]]) -> tuple[Turn, ...]:
    """Turns in degrees about body axes by name.

    Parameters
    ----------
    rotations : iterable of sequence
        Such as ``(-90.0, "Y")``; a third entry is the duration of the position in s, a fourth the
        rate in deg/s.

    Returns
    -------
    tuple of Turn
    """
    out = []
    for angle, axis, *rest in rotations:
        duration, rate, *_ = [*rest, None, None]
        about = None if rate is None else rate * DEGREE
        out.append(Turn(angle * DEGREE, AXES.index(axis), duration, about))
    return tuple(out)


@dataclass(frozen=True)
class Schedule:
    """A calibration path.

    Attributes
    ----------
    initial_posture : tuple of str
        Directions of the x, y and z body axes before the first turn, names of `DIRECTIONS`.
    turns : tuple of Turn
        The turns; there is one position more.
    position_duration : float
        Time from one position to the next, its turn included, s, where a turn does not say another.
    turn_rate : float
        Highest rate of turns, rad/s, where one does not say another.
    turn_acceleration : float or None
        With which a turn comes to its rate and back to rest, rad/s^2; None: at once.
    last_duration : float or None
        Of the last position, s, if another.
    """

    initial_posture: tuple[str, str, str]
    turns: tuple[Turn, ...]
    position_duration: float
    turn_rate: float
    turn_acceleration: float | None = None
    last_duration: float | None = None

    @property
    def positions(self) -> int:
        """Number of positions."""
        return len(self.turns) + 1

    @property
    def durations(self) -> np.ndarray:
        """Duration of every position, s, shape (positions,)."""
        own = [*(turn.duration for turn in self.turns), self.last_duration]
        return np.array([self.position_duration if one is None else one for one in own])

    @property
    def ends(self) -> np.ndarray:
        """Time at the end of every position, s, shape (positions,)."""
        return np.cumsum(self.durations)

    @property
    def duration(self) -> float:
        """Duration of the whole path, s."""
        return float(self.ends[-1])

    def rate_of(self, turn: Turn) -> float:
        """Highest rate of a turn, rad/s."""
        return self.turn_rate if turn.rate is None else turn.rate


@dataclass(frozen=True)
class Segment:
    """A stretch of rest, of steady rotation relative to the Earth, or of a ramp between the two.

    Attributes
    ----------
    start, end : float
        Time since the start of the schedule, s.
    attitude : ndarray, shape (3, 3)
        Body-to-NED matrix at `start`.
    rate : ndarray, shape (3,)
        Body rate relative to the Earth at `start`, in body axes, rad/s.
    acceleration : ndarray, shape (3,)
        Its time derivative, constant and along the same axis, rad/s^2.
    turn : int
        Number of the turn it is of, from 0; -1 at rest.
    """

    start: float
    end: float
    attitude: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray
    turn: int

    @property
    def is_turn(self) -> bool:
        """Whether the body turns; a ramp from rest does, though its rate starts at zero."""
        return self.turn >= 0

    @property
    def is_ramp(self) -> bool:
        """Whether the rate changes."""
        return bool(self.acceleration.any())

    def rate_at(self, times: np.ndarray) -> np.ndarray:
        """Body rate relative to the Earth, in body axes, rad/s, shape (len(times), 3)."""
        return self.rate + (times - self.start)[:, None] * self.acceleration

    def turned_at(self, times: np.ndarray) -> np.ndarray:
        """Rotation vector since the start, in body axes, rad, shape (len(times), 3)."""
        since = (times - self.start)[:, None]
        turned = since * self.rate
        return turned + 0.5 * since**2 * self.acceleration if self.is_ramp else turned


def initial_attitude(posture: Sequence[str]) -> np.ndarray:
    """Body-to-NED matrix of a posture.

    Parameters
    ----------
    posture : sequence of str
        Directions of the x, y and z body axes.

    Returns
    -------
    ndarray, shape (3, 3)

    Raises
    ------
    ValueError
        If the three directions are not a right-handed triad.
    """
    matrix = np.array([DIRECTIONS[name] for name in posture], dtype=float).T
    if matrix.shape != (3, 3) or not np.isclose(np.linalg.det(matrix), 1.0):
        raise ValueError(f"posture {list(posture)} is not a right-handed triad of directions")
    return matrix


def turn_vector(turn: Turn) -> np.ndarray:
    """Rotation vector of a turn in body axes, rad, shape (3,)."""
    vector = np.zeros(3)
    vector[turn.axis] = turn.angle
    return vector


def turned(attitude: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Body-to-NED matrix after a rotation by a vector in body axes, rad."""
    return np.asarray(attitude @ Rotation.from_rotvec(vector).as_matrix())


def attitudes(schedule: Schedule) -> np.ndarray:
    """Body-to-NED matrix of every dwell.

    Returns
    -------
    ndarray, shape (positions, 3, 3)
    """
    out = [initial_attitude(schedule.initial_posture)]
    for turn in schedule.turns:
        out.append(turned(out[-1], turn_vector(turn)))
    return np.array(out)


def postures(schedule: Schedule) -> list[tuple[str, str, str]]:
    """Named posture of every dwell, as in the paper's Table 1.

    Raises
    ------
    ValueError
        If a body axis points along none of the named directions.
    """
    names = {direction: name for name, direction in DIRECTIONS.items()}
    out = []
    for row, matrix in enumerate(attitudes(schedule), start=1):
        rounded = np.rint(matrix)
        if not np.allclose(matrix, rounded, atol=1e-9):
            raise ValueError(f"position {row} points an axis along no named direction")
        x, y, z = (names[(int(a), int(b), int(c))] for a, b, c in rounded.T)
        out.append((x, y, z))
    return out


def weak_pairs(schedule: Schedule) -> list[tuple[str, str, str]]:
    """Parameter pairs that a path's dwells cannot tell apart.

    An accelerometer's bias, scale factor and quadratic term act on its axis as 1, f and f^2. Three
    unknowns need three different f: the axis has to be seen up, level and down. Without up or down
    the scale factor and the quadratic term merge; without level the bias and the quadratic term do.

    Returns
    -------
    list of (str, str, str)
        Two parameter names and the direction never seen, e.g. ``"+y up"``.
    """
    down = attitudes(schedule)[:, 2, :]
    out = []
    for i, axis in enumerate("xyz"):
        scale, quadratic = f"accel_k{i + 1}{i + 1}", f"accel_quadratic_{axis}"
        component = down[:, i]
        if not (component < -0.5).any():
            out.append((scale, quadratic, f"+{axis} up"))
        if not (component > 0.5).any():
            out.append((scale, quadratic, f"+{axis} down"))
        if not (abs(component) < 0.5).any():
            out.append((f"accel_bias_{axis}", quadratic, f"{axis} level"))
    return out


def segments(schedule: Schedule) -> list[Segment]:
    """Dwells, turns and the ramps of turns, in order of time.

    Raises
    ------
    ValueError
        If a turn takes longer than a position.
    """
    out = []
    still = np.zeros(3)
    dwells = attitudes(schedule)
    ends = schedule.ends
    starts = ends - schedule.durations
    for position, (attitude, start, end) in enumerate(zip(dwells, starts, ends, strict=True)):
        if position == len(schedule.turns):
            out.append(Segment(start, end, attitude, still, still, -1))
            break
        vector = turn_vector(schedule.turns[position])
        angle = float(np.linalg.norm(vector))
        rate = schedule.rate_of(schedule.turns[position])
        profile = profile_of(angle, rate, schedule.turn_acceleration)
        turn_start = end - profile.duration
        if turn_start < start:
            raise ValueError(
                f"turn {position + 1} takes {profile.duration:g} s, which is longer than a position"
            )
        if turn_start > start:
            out.append(Segment(start, turn_start, attitude, still, still, -1))
        rest = Segment(turn_start, end, attitude, still, still, position)
        out += turning(rest, vector / angle, profile)
    return out


def turning(whole: Segment, axis: np.ndarray, profile: Profile) -> list[Segment]:
    """Ramp, plateau and ramp, as there are, of a turn.

    Parameters
    ----------
    whole : Segment
        The turn's time and its attitude at the start; its rates are not used.
    axis : ndarray, shape (3,)
        Unit vector of the body.
    profile : Profile

    Returns
    -------
    list of Segment
    """
    rate = axis * profile.rate
    if profile.ramp == 0.0:
        return [replace(whole, rate=rate)]
    acceleration = rate / profile.ramp
    out = [replace(whole, end=whole.start + profile.ramp, acceleration=acceleration)]
    if profile.steady > 0.0:
        out.append(_next(out[-1], whole.end - profile.ramp, rate, whole.acceleration))
    return [*out, _next(out[-1], whole.end, rate, -acceleration)]


def _next(segment: Segment, end: float, rate: np.ndarray, acceleration: np.ndarray) -> Segment:
    """Segment of the same turn from the end of one on."""
    attitude = turned(segment.attitude, segment.turned_at(np.array([segment.end]))[0])
    return Segment(segment.end, end, attitude, rate, acceleration, segment.turn)
