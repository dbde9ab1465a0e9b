r"""What one unit of each constant disturbance does to a record: linear, so also a budget's columns.

An effect is the change of the *apparent* true increments, those that the sensors of
`inscal.sensor` are given to report, in rad and m/s a step; and of the observations, m/s and m.
With t_k the start of step k, h its length, C its attitude (body to NED), w the table's rate in
body axes, B the integral of C^T over the step, g gravity and w_e the Earth's rate:

- **Drift** (per axis): the bias moves by s(t), which ends one unit above its start and has mean
  zero; linear, or 1 - exp(-t/T) (IEEE Std 1293-2018, trend and warm-up). Of scale factors: times
  the increment.
- **Accelerometer terms** (IEEE Std 1293-2018, model equation): asymmetry 1/2 \|f_i\|, cubic f_i^3,
  cross-coupling f_i f_j, pendulous f_j^2. Their means over a step are integrals of f as it turns,
  by Gauss-Legendre quadrature.
- **Gyros**: asymmetry 1/2 \|w_i\|; g-sensitivity, rate on axis i for force on axis j (IEEE Std
  1554, g-sensitive drift).
- **Arms**: at a place r in the body the specific force is larger by dw/dt x r + w x (w x r), w the
  inertial rate (Savage, Strapdown Analytics, 2000, sec. 8.1.4). Where a turn begins or ends at once
  dw/dt is a jump j = w x r of the velocity, in the attitude of that end. Navigation takes the force
  of a step for steady (`inscal.navigation`) and would turn the jump by half the step's angle theta,
  which short steps do not. So it is J(-theta) j at the start of a turn and -J(theta) j at its end
  (J of `inscal.rotation`), of which navigation makes that very jump at any step. In a ramp dw/dt is
  steady, and the mean of w x (w x r) has kappa^2/3 more of the table's part.
- **Site**: B times the change of -g and w_e. Latitude moves both; a deflection (xi, eta) tilts
  gravity by -g xi northwards and -g eta eastwards (Heiskanen and Moritz, Physical Geodesy, 1967,
  sec. 2-22).
- **Attitude** psi (NED, true C = (I + [psi x]) C): the force changes by C^T (psi x g), the Earth's
  rate by -C^T (psi x w_e) and the body's by C^T dpsi/dt. Turns by another angle, about another
  axis, or faster in their first half and slower in their second, which end in time and place, add
  C dw dt to psi; a base that tilts adds s(t).
- **Vibration**: the base accelerates by a cos(2 pi f t) + b sin(2 pi f t) along N, E, D.
- **Delay** of the accelerometers by d: the increment is that of a window d earlier, so it loses the
  last d of its step and gains that of the step before. Seen from its end f turns with w, so that
  what is lost is the series d f + d^2/2 w x f + ...; the rows are its terms. For d < 0 it is the
  first \|d\| of the next step. The rate is taken for steady within d, which in a ramp of a rad/s^2
  leaves out a d^3 g/6: below 1e-9 m/s of 1 ms. An arm's force is not delayed with it: 1 ms of 0.6
  mm/s^2.
- **Observations**: bias of the velocity. They are of the table's centre, which rests: a delay of
  them changes nothing, wherever the unit sits.

"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from inscal import earth
from inscal.disturbance import Disturbance
from inscal.path import Path, attitude_effect, turned_otherwise
from inscal.record import OBSERVED
from inscal.rotation import mean_rotation

DELAY_TERMS = 5
"""Terms of the delay's series: the next is below 1e-12 of f for 20 ms at 10 deg/s."""

_OTHERS = ((1, 2), (0, 2), (0, 1))


@dataclass(frozen=True)
class Effect:
    """Effects of some constants on a record, per unit.

    Attributes
    ----------
    increments : ndarray, shape (components, steps, 6)
        On apparent increments, rad and m/s.
    observations : ndarray, shape (components, OBSERVED)
        On every observation, m/s and m.
    """

    increments: np.ndarray
    observations: np.ndarray


def effect(path: Path, disturbance: Disturbance, source: str) -> Effect:
    """Effect of one unit of each constant of a source.

    Parameters
    ----------
    path : Path
    disturbance : Disturbance
        Its `drift_time` and `vibration_frequency` are used; sizes are not.
    source : str
        Key of `inscal.disturbance.COMPONENTS`.

    Returns
    -------
    Effect
    """
    seen = np.zeros((0, OBSERVED))
    if source == "observation_bias":
        change, seen = np.zeros((3, len(path.edges) - 1, 6)), np.eye(3, OBSERVED)
    elif source == "observation_delay":
        change = np.zeros((1, len(path.edges) - 1, 6))
    elif source == "vibration":
        change = _vibration(path, disturbance.vibration_frequency)
    elif source.endswith("_drift"):
        change = _drift(path, disturbance.drift_time, source)
    else:
        change = _LINEAR[source](path)
    if len(seen) == 0:
        seen = np.zeros((len(change), OBSERVED))
    return Effect(change, seen)


def bias(path: Path, source: str) -> np.ndarray:
    """Effect of a bias on each axis of the sensors that a source names first, (3, steps, 6)."""
    return _on_axes(source, -np.repeat(path.steps.duration[:, None], 3, axis=1))


def trend(edges: np.ndarray, time: float) -> np.ndarray:
    """Integral over each step of what rises by one from first to last edge with mean zero, s.

    Parameters
    ----------
    edges : ndarray, shape (steps + 1,)
        s.
    time : float
        Time constant, s; 0: linear.
    """
    x = edges / edges[-1]
    if time == 0.0:
        integral = 0.5 * x * (x - 1.0)
    else:
        k = edges[-1] / time
        whole, part = -np.expm1(-k) / k, -np.expm1(-k * x) / k
        integral = (x * whole - part) / -np.expm1(-k)
    return np.asarray(edges[-1] * np.diff(integral))


def _drift(path: Path, time: float, source: str) -> np.ndarray:
    integral = trend(path.edges, time)
    if "_scale_" in source:
        nominal = path.motion.angle if source.startswith("gyro") else path.motion.velocity
        moved = nominal * (integral / path.steps.duration)[:, None]
    else:
        moved = np.repeat(integral[:, None], 3, axis=1)
    return _on_axes(source, -moved)


def _on_axes(source: str, values: np.ndarray) -> np.ndarray:
    """Three constants, each of which acts on its own axis by `values`, (steps, 3)."""
    out = np.zeros((3, len(values), 6))
    first = 3 if source.startswith("accel") else 0
    for i in range(3):
        out[i, :, first + i] = values[:, i]
    return out


def _of_force(source: str, path: Path, function: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    return _on_axes(source, -path.mean_of(function) * path.steps.duration[:, None])


def _of_two_forces(path: Path, pendulous: bool) -> np.ndarray:
    out = np.zeros((6, path.motion.steps, 6))
    for i in range(3):
        for n, j in enumerate(_OTHERS[i]):
            first = j if pendulous else i
            mean = path.mean_of(_product(first, j))
            out[2 * i + n, :, 3 + i] = -mean * path.steps.duration
    return out


def _product(i: int, j: int) -> Callable[[np.ndarray], np.ndarray]:
    return lambda force: np.asarray(force[:, i] * force[:, j])


def _gyro_asymmetry(path: Path) -> np.ndarray:
    return _on_axes("gyro", -0.5 * np.abs(path.motion.angle))


def _g_sensitivity(path: Path) -> np.ndarray:
    out = np.zeros((9, path.motion.steps, 6))
    for i in range(3):
        for j in range(3):
            out[3 * i + j, :, i] = -path.motion.velocity[:, j]
    return out


def _arm(path: Path, place: np.ndarray, felt: np.ndarray) -> np.ndarray:
    """Velocity increments, (steps, 3), that a place adds to accelerometers, 1 where `felt`."""
    steps = path.steps
    w, table = path.motion.angle / steps.duration[:, None], steps.rate
    centripetal = np.cross(w, np.cross(w, place))
    centripetal += steps.ramp[:, None] ** 2 / 3.0 * np.cross(table, np.cross(table, place))
    out = felt * (centripetal * steps.duration[:, None] + np.cross(path.rate_change, place))
    turned = table * steps.duration[:, None]
    for jump, away in zip(path.jumps, (-turned, turned), strict=True):
        out += np.einsum("sij,sj->si", mean_rotation(away), felt * np.cross(jump, place))
    return np.asarray(out)


def _table_offset(path: Path) -> np.ndarray:
    out = np.zeros((3, path.motion.steps, 6))
    for m in range(3):
        out[m, :, 3:] = _arm(path, np.eye(3)[m], np.ones(3))
    return out


def _off_axis(path: Path) -> np.ndarray:
    out = np.zeros((6, path.motion.steps, 6))
    for i in range(3):
        for n, j in enumerate(_OTHERS[i]):
            out[2 * i + n, :, 3:] = _arm(path, np.eye(3)[j], np.eye(3)[i])
    return out


def _site(path: Path, gravity: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Effects of changes of gravity and Earth rate, each of shape (components, 3)."""
    return np.stack(
        [
            np.concatenate([path.steps.to_body @ w, path.steps.to_body @ -g], axis=1)
            for g, w in zip(gravity, rate, strict=True)
        ]
    )


def _gravity(path: Path) -> np.ndarray:
    return _site(path, np.eye(3)[2:], np.zeros((1, 3)))


def _latitude(path: Path) -> np.ndarray:
    small, (latitude, height) = 1e-4, (path.site.latitude, path.site.height)
    sides = latitude + small, latitude - small
    gravity = [earth.gravity_ned(side, height) for side in sides]
    rate = [earth.earth_rate_ned(side) for side in sides]
    unit = 0.5 / small
    return _site(path, (gravity[0] - gravity[1])[None] * unit, (rate[0] - rate[1])[None] * unit)


def _deflection(path: Path) -> np.ndarray:
    return _site(path, -path.gravity[2] * np.eye(3)[:2], np.zeros((2, 3)))


def _turn_angle(path: Path) -> np.ndarray:
    number, out = path.steps.turn, []
    for turn in range(path.turns):
        rate = path.steps.rate * (number == turn)[:, None]
        angle = np.linalg.norm(rate, axis=1) @ path.steps.duration
        # more of the angle in the turn's sense
        out.append(turned_otherwise(path, rate / angle))
    return np.array(out)


def _table_axis(path: Path) -> np.ndarray:
    out = []
    for i in range(3):
        for j in _OTHERS[i]:
            rate = np.zeros_like(path.steps.rate)
            rate[:, j] = path.steps.rate[:, i]
            out.append(turned_otherwise(path, rate))
    return np.array(out)


def _turn_rate(path: Path) -> np.ndarray:
    steps, edges = path.steps, path.edges
    faster = np.zeros_like(steps.rate)
    for turn in range(path.turns):
        own = np.flatnonzero(steps.turn == turn)
        middle = 0.5 * (edges[own[0]] + edges[own[-1] + 1])
        before = np.clip(middle - edges[own], 0.0, steps.duration[own]) / steps.duration[own]
        faster[own] = steps.rate[own] * (2.0 * before - 1.0)[:, None]
    return turned_otherwise(path, faster)[None]


def _base_tilt(path: Path) -> np.ndarray:
    level = trend(path.edges, 0.0) / path.steps.duration
    gain = path.steps.to_body / path.edges[-1]
    return np.array(
        [attitude_effect(path, np.outer(level, np.eye(3)[m]), gain[:, :, m]) for m in range(2)]
    )


def _vibration(path: Path, frequency: float) -> np.ndarray:
    phase = 2.0 * np.pi * frequency * path.edges
    integrals = np.diff(np.sin(phase)), -np.diff(np.cos(phase))
    out = np.zeros((6, path.motion.steps, 6))
    for n, integral in enumerate(integrals):
        mean = integral / (2.0 * np.pi * frequency * path.steps.duration)
        for m in range(3):
            out[3 * n + m, :, 3:] = path.steps.to_body[:, :, m] * mean[:, None]
    return out


def delay_series(path: Path) -> np.ndarray:
    """Effect of the powers d, ..., d^5 of a delay, then of those of its amount when negative.

    Returns
    -------
    ndarray, shape (2 * DELAY_TERMS, steps, 6)
    """
    out = np.zeros((2 * DELAY_TERMS, path.motion.steps, 6))
    first, last = path.edge_rates
    end, start = path.end_attitude.mT @ -path.gravity, path.steps.attitude.mT @ -path.gravity
    factor = 1.0
    for n in range(DELAY_TERMS):
        factor /= n + 1
        # what a step loses at its end; the first gains of a rest before it
        lost = factor * end
        out[n, :, 3:] = (
            np.concatenate([factor * (start[:1] if n == 0 else 0 * start[:1]), lost])[:-1] - lost
        )
        # advanced: it gains the first of the next step and loses its own
        gained = factor * start
        after = factor * (end[-1:] if n == 0 else 0 * end[-1:])
        out[DELAY_TERMS + n, :, 3:] = np.concatenate([gained, after])[1:] - gained
        end, start = np.cross(last, end), np.cross(-first, start)
    return out


_LINEAR: dict[str, Callable[[Path], np.ndarray]] = {
    "off_axis_lever_arm": _off_axis,
    "table_offset": _table_offset,
    "gyro_accel_delay": lambda path: delay_series(path)[:1],
    "accel_asymmetry": lambda path: _of_force("accel", path, lambda f: 0.5 * np.abs(f)),
    "accel_cubic": lambda path: _of_force("accel", path, lambda f: f**3),
    "accel_cross_coupling": lambda path: _of_two_forces(path, pendulous=False),
    "accel_pendulous": lambda path: _of_two_forces(path, pendulous=True),
    "gyro_asymmetry": _gyro_asymmetry,
    "gyro_g_sensitivity": _g_sensitivity,
    "gravity": _gravity,
    "latitude": _latitude,
    "deflection": _deflection,
    "turn_angle": _turn_angle,
    "turn_rate": _turn_rate,
    "table_axis": _table_axis,
    "base_tilt": _base_tilt,
}
