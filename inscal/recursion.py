"""Covariance and gain recursion: one for a schedule, shared by every run on it.

The gains depend on the schedule, the noise and the initial covariance, not on the run, so the
recursion runs once. To the filter's states it appends three constants, the attitude error at the
start: a fixed-point smoother (Simon, Optimal State Estimation, 2006, sec. 9.2), whose three rows of
gain let a later pass start aligned.

It carries a triangular square root of the covariance, P = L L^T, and never P itself (Bierman,
Factorization Methods for Discrete Sequential Estimation, 1977, ch. V to VII). Priors may be 1e8
times as wide as what the record leaves of them. P then holds numbers that differ by 1e16, which is
all that double precision can tell; their roots differ by 1e8. Against quadruple precision the
gains are right to 1e-9 at a thousandth of the reference noise, at priors a hundred times as wide,
and without any noise of the sensors.

Order of the states inside: modelled parameters (n), initial attitude (3), navigation (9). With the
constants first, L falls into blocks that fit the model:

    L = [ L_cc   0   ]      constants do not move, and no noise enters them
        [ L_nc  L_nn ]      navigation states

Augmented states that are constants follow the initial attitude; those that wander stand before the
navigation states and move with them.
"""

from dataclasses import dataclass

import numpy as np

from inscal import parameters
from inscal.augmented_transitions import AugmentedTransitions
from inscal.kernel import compiled, inlined
from inscal.record import OBSERVED
from inscal.state_model import (
    NAVIGATION,
    OBSERVED_STATES,
    NoiseModel,
    StateModel,
    Transitions,
)

ATTITUDE = 3
"""Appended states: the attitude error at the start."""
_FIRST = OBSERVED_STATES.start
_VECTOR = 8  # doubles
_ALIKE = 1e-9  # of the largest effect of an augmented state: differences that are rounding


@dataclass(frozen=True)
class InitialStd:
    """Initial standard deviations of the filter, SI.

    Attributes
    ----------
    attitude : ndarray, shape (3,)
        About North, East and Down, rad.
    velocity, position : float
        m/s and m, each component.
    parameter : ndarray, shape (27,)
        In state order.
    augmented : ndarray, shape (n,), optional
        Of augmented states that do not wander, where they are not those of the transitions.
    """

    attitude: np.ndarray
    velocity: float
    position: float
    parameter: np.ndarray
    augmented: np.ndarray | None = None

    @property
    def navigation(self) -> np.ndarray:
        """Sigmas of the nine navigation states, in state order, shape (9,)."""
        return np.concatenate([self.attitude, np.full(3, self.velocity), np.full(3, self.position)])


@dataclass(frozen=True)
class Gains:
    """What the recursion leaves for the runs.

    Attributes
    ----------
    gain : ndarray, shape (updates, 39 + augmented, 6)
        Kalman gains of the 9 navigation states, all 27 parameters (zero rows where the filter does
        not model one), the initial attitude, and the augmented states.
    covariance : ndarray, shape (c, c)
        Final covariance of the constants: the 27 parameters (zero where not modelled), the initial
        attitude, and the augmented states that do not wander; c is 30 without those.
    root : ndarray, shape (c, c)
        Its lower triangular square root: ``covariance = root @ root.T``.
    parameter_std : ndarray, shape (updates, 27)
        Standard deviation of the parameters after every update.
    innovation_covariance : ndarray, shape (updates, 6, 6)
        Predicted covariance of the innovations.
    whitening : ndarray, shape (updates, 6, 6)
        Lower triangular; times innovations of that covariance it makes six of unit covariance.
    """

    gain: np.ndarray
    covariance: np.ndarray
    root: np.ndarray
    parameter_std: np.ndarray
    innovation_covariance: np.ndarray
    whitening: np.ndarray


def observation_covariance(noise: NoiseModel) -> np.ndarray:
    """Covariance of one observation of velocity and position, shape (6, 6)."""
    return np.diag([noise.velocity**2] * 3 + [noise.position**2] * 3)


def compute_gains(
    transitions: Transitions,
    model: StateModel,
    noise: NoiseModel,
    std: InitialStd,
    observed: np.ndarray | None = None,
) -> Gains:
    """Run the recursion over a schedule.

    Parameters
    ----------
    transitions : Transitions
        Of the same state model.
    model : StateModel
    noise : NoiseModel
    std : InitialStd
    observed : ndarray, shape (updates, 6), optional
        Standard deviations of the observations, where they are not those of `noise` throughout.

    Returns
    -------
    Gains
    """
    updates, modelled = len(transitions.index), len(model.columns)
    moving, of_constants, noise_root, index = _by_update(transitions)
    augmented = transitions.augmented.constants if transitions.augmented else 0
    constants, fixed = modelled + ATTITUDE + augmented, parameters.COUNT + ATTITUDE + augmented
    wandering = moving.shape[1] - NAVIGATION
    rows = np.concatenate(
        [
            NAVIGATION + model.columns,
            NAVIGATION + np.arange(parameters.COUNT, fixed),
            NAVIGATION + fixed + np.arange(wandering),
            np.arange(NAVIGATION),
        ]
    )
    gain = np.zeros((updates, NAVIGATION + fixed + wandering, OBSERVED))
    variance = np.empty((updates, modelled))
    innovation_root = np.zeros((updates, OBSERVED, OBSERVED))
    columns = initial_root(model, std, transitions.augmented)
    _recur(
        columns,
        moving,
        of_constants,
        noise_root,
        index,
        np.sqrt(np.diag(observation_covariance(noise)))[None] if observed is None else observed,
        rows,
        gain,
        variance,
        innovation_root,
    )
    root = np.zeros((fixed, fixed))
    place = rows[:constants] - NAVIGATION
    root[np.ix_(place, place)] = columns[:constants, :constants].T
    std_history = np.zeros((updates, parameters.COUNT))
    std_history[:, model.columns] = np.sqrt(variance)
    return Gains(
        gain=gain,
        covariance=root @ root.T,
        root=root,
        parameter_std=std_history,
        innovation_covariance=innovation_root @ innovation_root.mT,
        whitening=np.linalg.inv(innovation_root),
    )


def refuse_degenerate(gains: Gains, model: StateModel) -> None:
    """Raise where the recursion leaves nothing that double precision can weigh.

    Parameters
    ----------
    gains : Gains
    model : StateModel
        That they were computed with.

    Raises
    ------
    ValueError
        If a predicted sigma of a modelled constant is zero or not finite.
    """
    sigma, modelled = np.sqrt(np.diag(gains.covariance)), set(model.columns)
    names = [*parameters.NAMES, *["the attitude at the start"] * ATTITUDE, *model.augmented]
    for constant, std in enumerate(sigma):
        if (constant >= parameters.COUNT or constant in modelled) and not 0.0 < std < np.inf:
            name = names[constant]
            raise ValueError(
                f"the filter's predicted sigma of {name} is {std:g}: its prior must be above zero, "
                "and all priors and noise of a size that double precision holds"
            )


def square_root(covariance: np.ndarray) -> np.ndarray:
    """Some G with G G^T the covariance, which may be singular or of mixed units."""
    scale = np.sqrt(np.diag(covariance))
    scale = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


def _by_update(
    transitions: Transitions,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Transposed transitions of the states that move, of constants to them, and roots of noise.

    Of each kind of update, and the kind of every update. What moves is those that wander, w, and
    navigation, n:

        w' = phi w + a u,    n' = Phi n + B (w + b u + c v) + noise,

    B being the effect of w on navigation.
    """
    about, noise = transitions.augmented, square_root(transitions.noise).T
    if about is None:
        kinds = np.zeros_like(transitions.index), transitions.index
        return (
            transitions.navigation.T[None].copy(),
            transitions.parameter.mT.copy(),
            noise[None].copy(),
            np.stack(kinds, axis=1),
        )
    index, first = transitions.index, np.unique(transitions.index, return_index=True)[1]
    steady = about.navigation[first][index]
    scale = np.abs(about.navigation).max(axis=(0, 1))
    if (np.abs(steady - about.navigation) > _ALIKE * scale).any():  # drifts differ in every update
        index, first = np.arange(len(index)), np.arange(len(index))
    of_parameters = transitions.parameter[transitions.index[first]].mT
    of_augmented, w = about.navigation[first].mT, about.wandering
    none = np.zeros((len(first), ATTITUDE, NAVIGATION))
    constants = [of_parameters, none, of_augmented[:, : about.constants]]
    moving = np.zeros((len(first), w + NAVIGATION, w + NAVIGATION))
    moving[:, range(w), range(w)] = about.decay
    moving[:, :w, w:] = of_augmented[:, about.constants :]
    moving[:, w:, w:] = transitions.navigation.T
    root = np.zeros((len(first), 2 * w + NAVIGATION, w + NAVIGATION))
    root[:, range(w), range(w)] = about.drive
    for unit in range(2):
        share = about.driven[:, unit, None]
        root[:, unit * w : (unit + 1) * w, w:] = share * of_augmented[:, about.constants :]
    root[:, 2 * w :, w:] = noise
    return moving, np.concatenate(constants, axis=1), root, np.stack([index, index], axis=1)


def initial_root(
    model: StateModel, std: InitialStd, augmented: AugmentedTransitions | None = None
) -> np.ndarray:
    """Columns of L at the start, each in a row whose end is padded to whole vectors."""
    further = np.zeros(0) if augmented is None else augmented.std.copy()
    if std.augmented is not None:
        further[: len(std.augmented)] = std.augmented
    own = len(model.columns)
    still = np.concatenate([std.parameter[model.columns], std.attitude, further])
    first = len(still)  # those that wander move, but what they are at the start does not
    states = first + NAVIGATION
    columns = np.zeros((states, -(-states // _VECTOR) * _VECTOR))
    columns[range(first), range(first)] = still
    # at the start the attitude error is the appended state itself
    columns[range(own, own + ATTITUDE), range(first, first + ATTITUDE)] = std.attitude
    moving = np.arange(first + ATTITUDE, states)
    columns[moving, moving] = np.repeat([std.velocity, std.position], 3)
    return columns


@compiled
def _recur(columns, phi_moving, phi_par, q, index, r, rows, gain, variance, roots):
    """Predict and update the root in place through all updates.

    `columns` holds the columns of L as its rows, so that what works on columns reads memory in
    order; `phi_moving`, `phi_par` and `q` are transposed likewise, and `r` holds standard
    deviations, a row for every update or one for all.
    """
    moving = phi_moving.shape[1]
    first, seen = len(columns) - moving, len(columns) - NAVIGATION + _FIRST
    kept = np.empty((OBSERVED, columns.shape[1]))  # gains times the root of S, transposed
    stacked = np.empty((moving + q.shape[1], moving))
    for k in range(len(index)):
        kind = index[k, 0]
        _predict(columns, first, phi_moving[kind], phi_par[index[k, 1]], q[kind], stacked)
        low = roots[k]  # of S, the covariance of the innovations
        own = r[k if len(r) > 1 else 0]
        for i in range(OBSERVED):
            low[i, i] = _observe(columns, seen + i, own[i], kept[i])
            for j in range(i):
                low[i, j] = kept[j, seen + i]
        _gain(kept, low, rows, gain[k])
        for c in range(variance.shape[1]):
            total = 0.0
            for j in range(c + 1):
                total += columns[j, c] * columns[j, c]
            variance[k, c] = total


@inlined
def _predict(columns, first, phi_moving, phi_par, q, stacked):
    """Carry the root over an interval.

    With F = [phi_moving phi_par] the rows of the transition that are not identity, of which those
    of constants are zero but for navigation,

        L_mc <- F (L_mc, L_cc),   L_mm <- the triangle of [phi_moving L_mm  G],   Q = G G^T.
    """
    moving, wandering = len(phi_moving), len(phi_moving) - NAVIGATION
    part = np.empty(moving)
    for j in range(len(columns)):
        part[:] = 0.0
        for c in range(moving):
            f = columns[j, first + c]
            for i in range(moving):
                part[i] += phi_moving[c, i] * f
        for c in range(j, len(phi_par)):
            f = columns[j, c]
            for i in range(NAVIGATION):
                part[wandering + i] += phi_par[c, i] * f
        for i in range(moving):
            if j < first:
                columns[j, first + i] = part[i]
            else:
                stacked[j - first, i] = part[i]
    stacked[moving:] = q
    _triangularise(stacked)
    for j in range(moving):
        for i in range(j, moving):
            columns[first + j, first + i] = stacked[j, i]


@inlined
def _triangularise(a):
    """Make an array upper triangular by Householder reflections, a^T a unchanged."""
    width = a.shape[1]
    product = np.empty(width)
    for j in range(width):
        square = 0.0
        for i in range(j, len(a)):
            square += a[i, j] * a[i, j]
        if square == 0.0:
            continue
        corner = -np.copysign(np.sqrt(square), a[j, j])
        scale = 1.0 / (square - a[j, j] * corner)
        a[j, j] -= corner
        product[:] = 0.0
        for i in range(j, len(a)):
            for c in range(j + 1, width):
                product[c] += a[i, j] * a[i, c]
        for i in range(j, len(a)):
            f = a[i, j] * scale
            for c in range(j + 1, width):
                a[i, c] -= f * product[c]
        a[j, j] = corner


@inlined
def _observe(columns, z, r, kept):
    """Update the root by one directly observed state, of standard deviation `r`.

    Plane rotations of the array's columns zero what L holds in row z,

        [ r  z-th row of L ]  ->  [ s  0  ]
        [ 0        L       ]      [ k  L+ ],

    and leave array times its transpose as it is: s^2 is the variance of the innovation, k / s the
    gain, and L+ the new root. From the last column to the first, L stays triangular. `kept` becomes
    k; returned is s.
    """
    kept[:] = 0.0
    s = r
    for j in range(z, -1, -1):
        f = columns[j, z]
        if f == 0.0:
            continue
        length = np.sqrt(s * s + f * f)
        cosine, sine = s / length, f / length
        s = length
        for c in range(j // _VECTOR * _VECTOR, len(kept)):
            k = kept[c]
            kept[c] = cosine * k + sine * columns[j, c]
            columns[j, c] = cosine * columns[j, c] - sine * k
    return s


@inlined
def _gain(kept, low, rows, gain):
    """K = W^T L^-1 by backward substitution, W^T the columns `kept` and L the root `low` of S."""
    for c in range(len(rows)):
        row = rows[c]
        for i in range(OBSERVED - 1, -1, -1):
            total = kept[i, c]
            for j in range(i + 1, OBSERVED):
                total -= low[j, i] * gain[row, j]
            gain[row, i] = total / low[i, i]
