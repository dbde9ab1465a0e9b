"""Covariance and gain recursion: one for a schedule, shared by every run on it.

The gains depend on the schedule, the noise and the initial covariance, not on the run, so the
recursion runs once. To the filter's states it appends three constants, the attitude error at the
start: a fixed-point smoother (Simon, Optimal State Estimation, 2006, sec. 9.2), whose three rows of
gain let a later pass start aligned.

State order: navigation (9), modelled parameters (n), initial attitude (3).
"""

from dataclasses import dataclass

import numpy as np

from inscal import parameters
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
    """

    attitude: np.ndarray
    velocity: float
    position: float
    parameter: np.ndarray

    @property
    def navigation(self) -> np.ndarray:
        """Sigmas of the nine navigation states, in state order, shape (9,)."""
        return np.concatenate([self.attitude, np.full(3, self.velocity), np.full(3, self.position)])


@dataclass(frozen=True)
class Gains:
    """What the recursion leaves for the runs.

    Attributes
    ----------
    gain : ndarray, shape (updates, 39, 6)
        Kalman gains of the 9 navigation states, all 27 parameters (zero rows where the filter does
        not model one) and the initial attitude.
    covariance : ndarray, shape (30, 30)
        Final covariance of the 27 parameters (zero where not modelled) and the initial attitude.
    parameter_std : ndarray, shape (updates, 27)
        Standard deviation of the parameters after every update.
    innovation_covariance : ndarray, shape (updates, 6, 6)
        Predicted covariance of the innovations.
    """

    gain: np.ndarray
    covariance: np.ndarray
    parameter_std: np.ndarray
    innovation_covariance: np.ndarray


def initial_covariance(model: StateModel, std: InitialStd) -> np.ndarray:
    """Covariance at the start, initial attitude appended, shape (states + 3, states + 3)."""
    sigma = np.concatenate([std.navigation, std.parameter[model.columns], std.attitude])
    covariance = np.diag(sigma**2)
    # at the start the appended states are the attitude error itself
    covariance[:ATTITUDE, -ATTITUDE:] = covariance[-ATTITUDE:, :ATTITUDE] = np.diag(std.attitude**2)
    return covariance


def observation_covariance(noise: NoiseModel) -> np.ndarray:
    """Covariance of one observation of velocity and position, shape (6, 6)."""
    return np.diag([noise.velocity**2] * 3 + [noise.position**2] * 3)


def compute_gains(
    transitions: Transitions, model: StateModel, noise: NoiseModel, std: InitialStd
) -> Gains:
    """Run the recursion over a schedule.

    Parameters
    ----------
    transitions : Transitions
        Of the same state model.
    model : StateModel
    noise : NoiseModel
    std : InitialStd

    Returns
    -------
    Gains
    """
    updates, states = len(transitions.index), model.states + ATTITUDE
    gain = np.empty((updates, states, OBSERVED))
    variance = np.empty((updates, len(model.columns)))
    innovation = np.empty((updates, OBSERVED, OBSERVED))
    covariance = initial_covariance(model, std)
    _recur(
        covariance,
        transitions.navigation,
        transitions.parameter,
        transitions.index,
        transitions.noise,
        np.diag(observation_covariance(noise)),
        gain,
        variance,
        innovation,
    )
    rows = np.concatenate(
        [
            np.arange(NAVIGATION),
            NAVIGATION + model.columns,
            NAVIGATION + parameters.COUNT + np.arange(ATTITUDE),
        ]
    )
    full_gain = gain
    if len(rows) < NAVIGATION + parameters.COUNT + ATTITUDE:
        full_gain = np.zeros((updates, NAVIGATION + parameters.COUNT + ATTITUDE, OBSERVED))
        full_gain[:, rows] = gain
    full_covariance = np.zeros((parameters.COUNT + ATTITUDE,) * 2)
    full_covariance[np.ix_(rows[NAVIGATION:] - NAVIGATION, rows[NAVIGATION:] - NAVIGATION)] = (
        covariance[NAVIGATION:, NAVIGATION:]
    )
    std_history = np.zeros((updates, parameters.COUNT))
    std_history[:, model.columns] = np.sqrt(variance)
    return Gains(full_gain, full_covariance, std_history, innovation)


@compiled
def _recur(p, phi_nav, phi_par, index, q, r, gain, variance, innovation):
    """Predict and update `p` in place through all updates.

    With F = [phi_nav phi_par] the rows of the transition that are not identity, prediction is

        P_n* <- F P_*,  P_nn <- P_n* F^T + Q,

    and the update of six directly observed states z, with S = P_zz + R = L L^T and W = L^-1 P_z*,

        K = P_*z S^-1 = W^T L^-1,  P <- P - W^T W.

    The last is symmetric by construction and needs no other form: S is six by six and R positive.
    """
    n = p.shape[0]
    rows = np.empty((NAVIGATION, n))
    w = np.empty((OBSERVED, n))
    low = np.empty((OBSERVED, OBSERVED))
    for k in range(len(index)):
        _predict(p, phi_nav, phi_par[index[k]], q, rows)
        _factor(p, r, innovation[k], low)
        _divide(p, low, w)
        _gain(w, low, gain[k])
        _update(p, w)
        for c in range(phi_par.shape[2]):
            variance[k, c] = p[NAVIGATION + c, NAVIGATION + c]


@inlined
def _predict(p, phi_nav, par, q, rows):
    """Carry the covariance over one interval; `rows` is room for P_n*."""
    nav = NAVIGATION
    n = p.shape[0]
    m = par.shape[1]
    for i in range(nav):
        for c in range(n):
            rows[i, c] = 0.0
        for j in range(nav):
            f = phi_nav[i, j]
            for c in range(n):
                rows[i, c] += f * p[j, c]
        for j in range(m):
            f = par[i, j]
            if f != 0.0:
                for c in range(n):
                    rows[i, c] += f * p[nav + j, c]
    for i in range(nav):
        for j in range(i + 1):
            total = q[i, j]
            for c in range(nav):
                total += rows[i, c] * phi_nav[j, c]
            for c in range(m):
                total += rows[i, nav + c] * par[j, c]
            p[i, j] = total
            p[j, i] = total
        for c in range(nav, n):
            p[i, c] = rows[i, c]
            p[c, i] = rows[i, c]


@inlined
def _factor(p, r, s, low):
    """Covariance S of the innovations into `s`, and its Cholesky factor L into `low`."""
    for i in range(OBSERVED):
        for j in range(i + 1):
            total = p[_FIRST + i, _FIRST + j]
            if i == j:
                total += r[i]
            s[i, j] = total
            s[j, i] = total
            for c in range(j):
                total -= low[i, c] * low[j, c]
            low[i, j] = np.sqrt(total) if i == j else total / low[j, j]


@inlined
def _divide(p, low, w):
    """W = L^-1 P_z*, by forward substitution."""
    n = p.shape[0]
    for i in range(OBSERVED):
        for c in range(n):
            w[i, c] = p[_FIRST + i, c]
        for j in range(i):
            f = low[i, j]
            for c in range(n):
                w[i, c] -= f * w[j, c]
        f = 1.0 / low[i, i]
        for c in range(n):
            w[i, c] *= f


@inlined
def _gain(w, low, gain):
    """K = W^T L^-1, by backward substitution."""
    for c in range(w.shape[1]):
        for i in range(OBSERVED - 1, -1, -1):
            total = w[i, c]
            for j in range(i + 1, OBSERVED):
                total -= low[j, i] * gain[c, j]
            gain[c, i] = total / low[i, i]


@inlined
def _update(p, w):
    """P <- P - W^T W."""
    n = p.shape[0]
    for i in range(n):
        for j in range(OBSERVED):
            f = w[j, i]
            for c in range(n):
                p[i, c] -= f * w[j, c]
