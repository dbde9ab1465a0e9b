"""What the filter believes: its states, their linear dynamics and their noise.

The state is the paper's (eq. 7): attitude error, velocity error, position error, then the modelled
sensor parameters. In phi-angle form, with C_hat = (I - [phi x]) C and parameters true minus
estimated, the dynamics are (paper eqs. 4-6)

    d(phi)/dt = -w_in x phi + dw_in + C (dKg w + eps)
    d(dV)/dt  = f_n x phi - (2 w_ie + w_en) x dV - C (dKa f + nabla + D2 f^2 + f_L) + dg
    d(dp)/dt  = dV

with the terms of the sensors, f_L among them, as in `inscal.sensor`.
Position error is kept in metres north, metres east and metres of height. The gravity error dg,
which the paper neglects, is kept to first order in height: it costs nothing, and the linear model
is then the derivative of the navigation equations.

On the table the velocity is zero and the position fixed, so the navigation block of the dynamics is
one constant matrix; only the parameter columns turn with the body.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
from scipy.linalg import expm

from inscal import earth, parameters
from inscal.augmented_transitions import AugmentedTransitions
from inscal.motion import Site, attitude_at, cut, update_count, update_of
from inscal.record import OBSERVED
from inscal.rotation import skew
from inscal.schedule import Schedule, Segment, segments

NAVIGATION = 9
"""Navigation states, three each: attitude (N, E, D), velocity (N, E, D), position (N, E, h)."""

OBSERVED_STATES = slice(3, 3 + OBSERVED)
"""The observed navigation states: velocity and position errors."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)
_LONGEST_ARC = 1.0  # rad that the quadrature goes at a time


@dataclass(frozen=True)
class StateModel:
    """The parameters a filter estimates; all others it believes to be exactly zero.

    Attributes
    ----------
    groups : tuple of str
        Keys of `parameters.GROUPS` and of `parameters.AUGMENTATIONS`, in any order. The six of the
        former make the paper's 36 states; leaving out ``accel_quadratic`` and ``lever_arm`` makes
        the classic 30.
    """

    groups: tuple[str, ...] = tuple(parameters.GROUPS)

    @property
    def columns(self) -> np.ndarray:
        """Indices of the modelled parameters in a 27-vector, in state order."""
        return np.concatenate(
            [
                np.arange(parameters.COUNT)[s]
                for g, s in parameters.INDEX.items()
                if g in self.groups
            ]
        )

    @property
    def augmentations(self) -> dict[str, parameters.Augmentation]:
        """Augmented groups by name, in state order."""
        every = parameters.AUGMENTATIONS
        return {name: about for name, about in every.items() if name in self.groups}

    @property
    def augmented(self) -> tuple[str, ...]:
        """Names of the augmented states, in state order."""
        return tuple(name for about in self.augmentations.values() for name in about.names)

    @property
    def states(self) -> int:
        """Number of filter states."""
        return NAVIGATION + len(self.columns) + len(self.augmented)


@dataclass(frozen=True)
class NoiseModel:
    """White noise densities of the sensors and standard deviations of the observations, SI.

    Attributes
    ----------
    gyro : float
        Angle random walk, rad/sqrt(s).
    accel : float
        Accelerometer white noise, m/s^2/sqrt(Hz); over t seconds the velocity walks by
        ``accel * sqrt(t)``.
    velocity : float
        Velocity observation, m/s per component.
    position : float
        Position observation, m per component.
    """

    gyro: float
    accel: float
    velocity: float
    position: float


@dataclass(frozen=True)
class Transitions:
    """The discrete linear model between updates.

    Attributes
    ----------
    navigation : ndarray, shape (9, 9)
        Transition of the navigation states over one update interval.
    parameter : ndarray, shape (distinct, 9, n)
        Effect of the parameters on the navigation states over one interval.
    index : ndarray of int, shape (updates,)
        Which of `parameter` leads to each update.
    noise : ndarray, shape (9, 9)
        Covariance that sensor noise adds over one interval.
    dynamics : ndarray, shape (9, 9)
        Continuous dynamics of the navigation states, 1/s.
    interval : float
        Between updates, s.
    augmented : AugmentedTransitions or None
        Of the augmented states.
    """

    navigation: np.ndarray
    parameter: np.ndarray
    index: np.ndarray
    noise: np.ndarray
    dynamics: np.ndarray
    interval: float
    augmented: AugmentedTransitions | None = None


def navigation_dynamics(site: Site) -> np.ndarray:
    """Continuous dynamics of the navigation states at rest.

    Parameters
    ----------
    site : Site

    Returns
    -------
    ndarray, shape (9, 9)
        Time derivative of (phi, dV, dp) per unit of each, SI.
    """
    sin_lat, cos_lat, tan_lat = np.sin(site.latitude), np.cos(site.latitude), np.tan(site.latitude)
    meridian, prime_vertical = earth.radii_of_curvature(sin_lat)
    radius_n, radius_e = meridian + site.height, prime_vertical + site.height
    w_ie = earth.earth_rate_ned(site.latitude)
    gravity = earth.gravity_ned(site.latitude, site.height)

    a = np.zeros((NAVIGATION, NAVIGATION))
    a[0:3, 0:3] = -skew(w_ie)
    a[0, 4], a[1, 3], a[2, 4] = 1 / radius_e, -1 / radius_n, -tan_lat / radius_e
    a[0:3, 6] = earth.EARTH_RATE * np.array([-sin_lat, 0.0, -cos_lat]) / radius_n
    a[3:6, 0:3] = skew(-gravity)
    a[3:6, 3:6] = -2 * skew(w_ie)
    step = 1.0  # m; the central difference is exact for a quadratic
    a[5, 8] = (
        earth.normal_gravity(sin_lat, site.height + step)
        - earth.normal_gravity(sin_lat, site.height - step)
    ) / (2 * step)
    a[6, 3] = a[7, 4] = 1.0
    a[8, 5] = -1.0
    return a


def parameter_dynamics(
    attitude: np.ndarray, angular_rate: np.ndarray, specific_force: np.ndarray
) -> np.ndarray:
    """Effect of the 27 parameter errors on the navigation states' rates.

    Parameters
    ----------
    attitude : ndarray, shape (..., 3, 3)
        Body-to-NED matrix.
    angular_rate : ndarray, shape (..., 3)
        Body rate relative to inertial space, in body axes, rad/s.
    specific_force : ndarray, shape (..., 3)
        In body axes, m/s^2.

    Returns
    -------
    ndarray, shape (..., 9, 27)
        Parameters in the order of `parameters.NAMES`, SI.
    """
    w, f = np.asarray(angular_rate), np.asarray(specific_force)
    gyro = np.zeros((*w.shape[:-1], 3, parameters.COUNT))
    accel = np.zeros_like(gyro)
    index = parameters.INDEX
    gyro[..., index["gyro_bias"]] = np.eye(3)
    accel[..., index["accel_bias"]] = np.eye(3)
    for name, column in zip(parameters.GROUPS["gyro_k"], _range("gyro_k"), strict=True):
        gyro[..., int(name[-2]) - 1, column] = w[..., int(name[-1]) - 1]
    for name, column in zip(parameters.GROUPS["accel_k"], _range("accel_k"), strict=True):
        accel[..., int(name[-2]) - 1, column] = f[..., int(name[-1]) - 1]
    centripetal = np.sum(w**2, axis=-1, keepdims=True) - w**2
    for i in range(3):
        accel[..., i, _range("accel_quadratic")[i]] = f[..., i] ** 2
        accel[..., i, _range("lever_arm")[i]] = centripetal[..., i]
    out = np.zeros((*w.shape[:-1], NAVIGATION, parameters.COUNT))
    out[..., 0:3, :] = attitude @ gyro
    out[..., 3:6, :] = -(attitude @ accel)
    return out


def _range(group: str) -> Sequence[int]:
    return range(parameters.COUNT)[parameters.INDEX[group]]


def build_transitions(
    schedule: Schedule,
    site: Site,
    model: StateModel,
    noise: NoiseModel,
    *,
    update_interval: float,
) -> Transitions:
    """Discrete linear model of a schedule, about true motion and error-free sensors.

    The parameter columns are integrated by six-point Gauss-Legendre quadrature over every stretch
    of rest, steady motion or a ramp, a radian of it at most at a time: to that the trigonometric
    polynomials of a turn are known to 1e-9.

    Parameters
    ----------
    schedule : Schedule
    site : Site
    model : StateModel
    noise : NoiseModel
    update_interval : float
        s.

    Returns
    -------
    Transitions

    Raises
    ------
    ValueError
        If the schedule is not a whole number of update intervals long, or a turn does not fit.
    """
    updates = update_count(schedule, update_interval)
    a = navigation_dynamics(site)
    columns, index = columns_of(segments(schedule), site, a, update_interval, updates)
    return Transitions(
        navigation=expm(a * update_interval),
        parameter=columns[:, :, model.columns],
        index=index,
        noise=noise_of(a, noise, update_interval),
        dynamics=a,
        interval=update_interval,
    )


def columns_of(
    parts: Sequence[Segment], site: Site, a: np.ndarray, update_interval: float, updates: int
) -> tuple[np.ndarray, np.ndarray]:
    """Effect of the 27 parameters on the navigation states over the updates of a stretch.

    Parameters
    ----------
    parts : sequence of Segment
        Whose first begins with an update interval.
    site : Site
    a : ndarray, shape (9, 9)
        Of `navigation_dynamics`.
    update_interval : float
        s.
    updates : int

    Returns
    -------
    columns : ndarray, shape (distinct, 9, 27)
    index : ndarray of int, shape (updates,)
        Which of them leads to each update.
    """
    carries = _carries(a)
    distinct: list[np.ndarray] = []
    index = np.full(updates, -1)
    for segment in parts:
        edges = cut(segment, update_interval)
        update = update_of(edges, update_interval)
        if segment.is_turn:
            members = [[k] for k in range(len(update))]
        else:  # all whole intervals of a dwell are alike
            whole = np.diff(edges) > update_interval * (1 - 1e-9)
            members = [np.flatnonzero(whole).tolist()]
            members += [[int(k)] for k in np.flatnonzero(~whole)]
        for pieces in filter(None, members):
            start, end = edges[pieces[0]], edges[pieces[0] + 1]
            interval_end = (update[pieces[0]] + 1) * update_interval
            column = _integrate(segment, site, carries, start, end, interval_end)
            if len(pieces) == 1 and index[update[pieces[0]]] >= 0:
                distinct[index[update[pieces[0]]]] += column
            else:
                index[update[pieces]] = len(distinct)
                distinct.append(column)
    return np.array(distinct), index


def _integrate(segment, site, carries, start, end, interval_end) -> np.ndarray:
    """Parameter columns of one piece, carried on to the end of its update interval."""
    fastest = np.linalg.norm(segment.rate_at(np.array([start, end])), axis=1).max()
    parts = max(1, int(np.ceil(fastest * (end - start) / _LONGEST_ARC - 1e-9)))
    edges = np.linspace(start, end, parts + 1)
    columns = (
        _integrate_part(segment, site, carries, first, last, interval_end)
        for first, last in pairwise(edges)
    )
    return np.asarray(sum(columns))


def _integrate_part(segment, site, carries, start, end, interval_end) -> np.ndarray:
    times = 0.5 * (start + end) + 0.5 * (end - start) * _NODES
    attitude = attitude_at(segment, times)
    to_body = np.swapaxes(attitude, -1, -2)
    rate = segment.rate_at(times) + to_body @ earth.earth_rate_ned(site.latitude)
    force = to_body @ -earth.gravity_ned(site.latitude, site.height)
    columns = parameter_dynamics(attitude, rate, force)
    carry = carries(round(interval_end - start, 9), round(interval_end - end, 9))
    return np.einsum("t,tij,tjk->ik", 0.5 * (end - start) * _WEIGHTS, carry, columns)


def _carries(a: np.ndarray) -> Callable[[float, float], np.ndarray]:
    """Transitions from the nodes of a piece to the end of its interval, by the piece's place in it.

    Most pieces fill their interval, so a few sets of matrix exponentials serve them all.
    """

    @cache
    def carries(first: float, last: float) -> np.ndarray:
        nodes = 0.5 * (first + last) + 0.5 * (last - first) * _NODES
        return np.array([expm(a * t) for t in nodes])

    return carries


def noise_covariance(transitions: Transitions, noise: NoiseModel) -> np.ndarray:
    """Covariance that other sensor noise would add over an interval of these transitions.

    Parameters
    ----------
    transitions : Transitions
    noise : NoiseModel

    Returns
    -------
    ndarray, shape (9, 9)
    """
    return noise_of(transitions.dynamics, noise, transitions.interval)


def noise_of(a: np.ndarray, noise: NoiseModel, interval: float) -> np.ndarray:
    """Covariance that sensor noise adds over an interval; equal on all axes, so it does not turn.

    Parameters
    ----------
    a : ndarray, shape (9, 9)
        Of `navigation_dynamics`.
    noise : NoiseModel
    interval : float
        s.

    Returns
    -------
    ndarray, shape (9, 9)
        By van Loan's integral.
    """
    n = NAVIGATION
    density = np.zeros((n, n))
    density[0:3, 0:3] = np.square(noise.gyro) * np.eye(3)
    density[3:6, 3:6] = np.square(noise.accel) * np.eye(3)
    block = expm(np.block([[-a, density], [np.zeros((n, n)), a.T]]) * interval)
    covariance = block[n:, n:].T @ block[:n, n:]
    return 0.5 * (covariance + covariance.T)
