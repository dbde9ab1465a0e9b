"""What a schedule makes observable: ranks of the paper's kind, and what sigma says beyond them.

**Rank.** A piecewise constant system x' = A_j x, z = H x is observable over pieces 1 ... r if the
stripped observability matrix

    Q_s(r) = [Q_1; ...; Q_r],  Q_j = [H; H A_j; ...; H A_j^(n-1)]

has full rank (Goshen-Meskin & Bar-Itzhack, Observability analysis of piecewise constant systems,
IEEE Trans. AES 28, 1992). A calibration path is not piecewise constant: in a turn A changes all
the time. What A_j is to be is therefore a choice, a `Convention`, and the rank depends on it.

It depends on the tolerance too. `ranks` counts as `numpy.linalg.matrix_rank` does, on rows of
different units. `unit_free_ranks` measures each state in its initial sigma, each observation in its
noise and time in positions, with rows A^k / k!: the Taylor terms of what a position shows.

**Sigma.** The covariance recursion needs no convention: how far each parameter's sigma has fallen,
which combination fell least, which pairs stay tied.

The dynamics are those of `inscal.state_model` without its gravity gradient, which the paper
neglects; no rank depends on it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from inscal import earth
from inscal.motion import Site
from inscal.parameters import COUNT, INDEX
from inscal.record import OBSERVED
from inscal.schedule import Schedule, attitudes, turn_vector
from inscal.state_model import (
    NAVIGATION,
    OBSERVED_STATES,
    navigation_dynamics,
    parameter_dynamics,
)

STATES = NAVIGATION + COUNT
"""The paper's 36 states."""

UNIT_FREE_TOLERANCE = 1e-12
"""Share of the largest singular value from which on a direction counts, in unit-free terms. On the
paper's path singular values lie above 1e-10 or below 1e-15, whatever the convention."""

_VERTICAL_VELOCITY, _HEIGHT = 5, 8
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)

Rates = Literal["none", "earth", "turning"]
Software = Literal["numpy", "matlab"]


@dataclass(frozen=True)
class Window:
    """A position with its turns, over which a convention averages.

    Attributes
    ----------
    dwell : float
        s.
    turn_rate : float
        Rate of the turn into the position and of the one out of it, rad/s.
    """

    dwell: float
    turn_rate: float


@dataclass(frozen=True)
class Convention:
    """What the constant A_j of a position is; its attitude is always that of the dwell.

    Attributes
    ----------
    gyro : str
        Body rate in the columns of the gyros: ``earth`` or ``turning``, the Earth's and that of the
        turn that ends the position.
    lever : str
        Body rate in the columns of the lever arm, or ``none``.
    lever_from : int
        Position, counted from 0, from which on the columns of the lever arm are there.
    window : Window or None
        If given, rates and specific force are averages over turn in, dwell and turn out.
    quadratic_scale : float
        Factor on the columns of the quadratic terms; 1 is SI.
    """

    gyro: Rates = "earth"
    lever: Rates = "none"
    lever_from: int = 0
    window: Window | None = None
    quadratic_scale: float = 1.0


@dataclass(frozen=True)
class Ranks:
    """Rank of the stripped observability matrix after each position.

    Attributes
    ----------
    values : ndarray, shape (positions, 36)
        Singular values over the tolerance, descending: those above 1 count.
    """

    values: np.ndarray

    @property
    def rank(self) -> np.ndarray:
        """Rank after each position, shape (positions,)."""
        return (self.values > 1.0).sum(axis=1)

    @property
    def margins(self) -> tuple[float, float]:
        """Smallest singular value that counts and largest that does not, over the tolerance."""
        counts = self.values > 1.0
        return float(self.values[counts].min()), float(self.values[~counts].max(initial=0.0))

    def tolerances_for(self, sequence: Sequence[int]) -> tuple[float, float]:
        """Factors on the tolerance between which the ranks would be those of `sequence`.

        Parameters
        ----------
        sequence : sequence of int
            One rank per position, at least 1.

        Returns
        -------
        tuple of 2 float
            From the first, inclusive, to the second, exclusive; none if the first is not smaller.
        """
        padded = np.pad(self.values, ((0, 0), (0, 1)))
        row = np.arange(len(padded))
        wanted = np.asarray(sequence)
        return float(padded[row, wanted].max()), float(padded[row, wanted - 1].min())


def system_matrices(schedule: Schedule, site: Site, convention: Convention) -> np.ndarray:
    """Constant dynamics of every position.

    Parameters
    ----------
    schedule : Schedule
    site : Site
    convention : Convention

    Returns
    -------
    ndarray, shape (positions, 36, 36)
        SI: rad, m/s and m, then the parameters in state order.
    """
    navigation = navigation_dynamics(site)
    navigation[_VERTICAL_VELOCITY, _HEIGHT] = 0.0  # the gravity gradient
    dwell = attitudes(schedule)
    earth_rate, turning, force = _seen(schedule, site, dwell, convention.window)
    rates = {"none": np.zeros_like(earth_rate), "earth": earth_rate, "turning": turning}
    columns = parameter_dynamics(dwell, rates[convention.gyro], force)
    lever = INDEX["lever_arm"]
    columns[..., lever] = parameter_dynamics(dwell, rates[convention.lever], force)[..., lever]
    columns[: convention.lever_from, :, lever] = 0.0
    columns[..., INDEX["accel_quadratic"]] *= convention.quadratic_scale
    out = np.zeros((len(dwell), STATES, STATES))
    out[:, :NAVIGATION, :NAVIGATION] = navigation
    out[:, :NAVIGATION, NAVIGATION:] = columns
    return out


def _seen(
    schedule: Schedule, site: Site, dwell: np.ndarray, window: Window | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Earth rate, whole rate and specific force of every position in body axes, each (p, 3)."""
    earth_ned = earth.earth_rate_ned(site.latitude)
    force_ned = -earth.gravity_ned(site.latitude, site.height)
    turn = np.array([*map(turn_vector, schedule.turns), np.zeros(3)])
    if window is None:
        to_body = dwell.mT
        angle = np.linalg.norm(turn, axis=1, keepdims=True)
        rate = np.divide(turn, angle, out=np.zeros_like(turn), where=angle > 0)
        return (
            to_body @ earth_ned,
            to_body @ earth_ned + rate * schedule.turn_rate,
            to_body @ force_ned,
        )
    # sums over time; the turn into a position is that of the one before
    length = np.linalg.norm(turn, axis=1) / window.turn_rate
    swept = np.array([_swept(c, v, t) for c, v, t in zip(dwell, turn, length, strict=True)])
    to_body = window.dwell * dwell.mT + swept
    to_body[1:] += swept[:-1]
    angle, whole = turn.copy(), window.dwell + length
    angle[1:] += turn[:-1]
    whole[1:] += length[:-1]
    to_body /= whole[:, None, None]
    return to_body @ earth_ned, to_body @ earth_ned + angle / whole[:, None], to_body @ force_ned


def _swept(attitude: np.ndarray, turn: np.ndarray, length: float) -> np.ndarray:
    """Integral over a turn of the NED-to-body matrix, s, shape (3, 3)."""
    turned = Rotation.from_rotvec(0.5 * (_NODES[:, None] + 1.0) * turn).as_matrix()
    return np.einsum("t,tij->ji", 0.5 * length * _WEIGHTS, attitude @ turned)


def stripped_blocks(dynamics: np.ndarray, blocks: int = STATES) -> np.ndarray:
    """Observability blocks Q_j of every position, in the units of the dynamics.

    Parameters
    ----------
    dynamics : ndarray, shape (positions, 36, 36)
        From `system_matrices`.
    blocks : int
        Powers of A, the zeroth included.

    Returns
    -------
    ndarray, shape (positions, 6 * blocks, 36)
        Observed are velocity and position errors, states 3 to 8.
    """
    rows = np.broadcast_to(np.eye(STATES)[OBSERVED_STATES], (len(dynamics), OBSERVED, STATES))
    out = [rows]
    for _ in range(blocks - 1):
        out.append(out[-1] @ dynamics)
    return np.concatenate(out, axis=1)


def ranks(dynamics: np.ndarray, software: Software = "numpy") -> Ranks:
    """Rank of Q_s(r) in SI by the default tolerance of common software.

    Parameters
    ----------
    dynamics : ndarray, shape (positions, 36, 36)
    software : str
        ``numpy`` (`numpy.linalg.matrix_rank`): the longer side of Q_s(r) times the machine epsilon
        times the largest singular value s. ``matlab`` (its ``rank``): the longer side times
        ``eps(s)``, the distance from s to the next number, which is one to a half of the former.

    Returns
    -------
    Ranks
    """

    def tolerance(largest: float, side: int) -> float:
        step = np.spacing(largest) if software == "matlab" else np.finfo(float).eps * largest
        return side * float(step)

    return _ranks(stripped_blocks(dynamics), tolerance)


def unit_free_ranks(
    dynamics: np.ndarray,
    state_sigma: np.ndarray,
    observation_sigma: np.ndarray,
    duration: float,
    tolerance: float = UNIT_FREE_TOLERANCE,
) -> Ranks:
    """Rank of Q_s(r) with every row and column measured in something physical.

    Parameters
    ----------
    dynamics : ndarray, shape (positions, 36, 36)
    state_sigma : ndarray, shape (36,)
        Initial standard deviations, SI.
    observation_sigma : ndarray, shape (6,)
        Noise of one observation of velocity and position, SI.
    duration : float
        Time from one position to the next, s.
    tolerance : float
        Share of the largest singular value.

    Returns
    -------
    Ranks
    """
    order = np.maximum(1, np.arange(STATES))
    taylor = np.cumprod(np.where(np.arange(STATES) > 0, duration / order, 1.0))
    row = np.repeat(taylor, OBSERVED) / np.tile(observation_sigma, STATES)
    blocks = stripped_blocks(dynamics) * row[:, None] * state_sigma
    return _ranks(blocks, lambda largest, _: tolerance * largest)


def _ranks(blocks: np.ndarray, tolerance: Callable[[float, int], float]) -> Ranks:
    values = []
    for count in range(1, len(blocks) + 1):
        matrix = blocks[:count].reshape(-1, STATES)
        own = np.linalg.svd(matrix, compute_uv=False)
        values.append(own / tolerance(float(own[0]), max(matrix.shape)))
    return Ranks(np.array(values))


def sigma_share(
    parameter_std: np.ndarray, prior: np.ndarray, schedule: Schedule, update_interval: float
) -> np.ndarray:
    """Standard deviation of every parameter at the end of every position, over the initial one.

    Parameters
    ----------
    parameter_std : ndarray, shape (updates, 27)
        Of `inscal.recursion.Gains`.
    prior : ndarray, shape (27,)
        Initial standard deviations in the same unit.
    schedule : Schedule
    update_interval : float
        s.

    Returns
    -------
    ndarray, shape (positions, 27)
    """
    ends = schedule.ends / update_interval
    return parameter_std[np.rint(ends).astype(int) - 1] / prior


@dataclass(frozen=True)
class Direction:
    """A combination of parameters, each in units of its initial sigma.

    Attributes
    ----------
    share : float
        Final over initial standard deviation of the combination.
    weights : tuple of (int, float)
        Index and weight of the parameters that make it up, heaviest first; squares of all weights
        add up to 1, the first weight is positive.
    """

    share: float
    weights: tuple[tuple[int, float], ...]


def weakest_directions(
    covariance: np.ndarray, prior: np.ndarray, count: int, least_weight: float = 0.3
) -> list[Direction]:
    """Combinations that the data told least about, next to what was known before.

    Parameters
    ----------
    covariance : ndarray, shape (27, 27)
        Final covariance.
    prior : ndarray, shape (27,)
        Initial standard deviations in the same units.
    count : int
    least_weight : float
        Parameters of smaller weight are not named.

    Returns
    -------
    list of Direction
        Eigenvectors of the covariance in units of the prior sigmas, weakest first.
    """
    values, vectors = np.linalg.eigh(covariance / np.outer(prior, prior))
    out = []
    for value, vector in zip(values[::-1][:count], vectors.T[::-1], strict=False):
        heaviest = np.argsort(-np.abs(vector))
        vector = vector * np.sign(vector[heaviest[0]])
        named = [(int(i), float(vector[i])) for i in heaviest if abs(vector[i]) >= least_weight]
        out.append(Direction(float(np.sqrt(max(value, 0.0))), tuple(named)))
    return out


def tied_pairs(covariance: np.ndarray, least: float) -> list[tuple[int, int, float]]:
    """Pairs of parameters whose errors go together.

    Parameters
    ----------
    covariance : ndarray, shape (27, 27)
    least : float
        Smallest absolute correlation.

    Returns
    -------
    list of (int, int, float)
        Indices and correlation, strongest first.
    """
    sigma = np.sqrt(np.diag(covariance))
    # a parameter the filter does not model has no sigma and is tied to nothing
    product = np.outer(sigma, sigma)
    correlation = np.divide(covariance, product, out=np.zeros_like(product), where=product > 0)
    first, second = np.triu_indices(len(sigma), 1)
    chosen = np.abs(correlation[first, second]) >= least
    pairs = [
        (int(i), int(j), float(correlation[i, j]))
        for i, j in zip(first[chosen], second[chosen], strict=True)
    ]
    return sorted(pairs, key=lambda pair: -abs(pair[2]))
