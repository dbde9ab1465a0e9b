"""The closed-loop calibrator: strapdown navigation, shared gains, one or more passes.

A run is navigated with compensated increments; at every update the six differences between
navigated and observed velocity and position, times the gains of `inscal.recursion`, correct all
states at once. Nothing of the covariance is computed per run.

How several passes over one record connect is the subject of `inscal.estimator`.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from inscal import navigation
from inscal.estimator import CONSTANTS, Estimator
from inscal.kernel import CACHE_LINE, LANES, compiled, inlined, prefetch
from inscal.motion import Motion, Site
from inscal.navigation import advance, rotate_left
from inscal.parameters import COUNT
from inscal.record import OBSERVED, Record
from inscal.sensor import compensate
from inscal.state_model import NAVIGATION

_NAV = CONSTANTS
_ROWS = _NAV + navigation.ROWS
_STEP_BYTES = 8 * 6 * LANES
_GAIN_BYTES = 8 * OBSERVED * (NAVIGATION + CONSTANTS)
_AHEAD = 2  # steps from the asking for data to its use: farther ahead was a little slower


@dataclass(frozen=True)
class History:
    """Course of the passes, at every update.

    Attributes
    ----------
    estimate : ndarray, shape (passes, updates, 27, LANES)
        Parameters, SI, as the pass itself has them. The last of a later pass is not yet its result,
        which is translated from it (`inscal.estimator`).
    innovation : ndarray, shape (passes, updates, 6, LANES)
        Navigated minus observed, m/s and m.
    """

    estimate: np.ndarray
    innovation: np.ndarray


def empty_history(passes: int, updates: int) -> History:
    """Room for the course of `passes` passes."""
    return History(
        np.empty((passes, updates, COUNT, LANES)), np.empty((passes, updates, OBSERVED, LANES))
    )


def calibrate(
    record: Record,
    motion: Motion,
    site: Site,
    estimator: Estimator,
    *,
    history: History | None = None,
) -> np.ndarray:
    """Estimate the sensor parameters of `LANES` runs.

    Parameters
    ----------
    record : Record
    motion : Motion
        Only its step lengths and update times are used.
    site : Site
    estimator : Estimator
    history : History, optional
        Filled with the course of the passes.

    Returns
    -------
    ndarray, shape (27, LANES)
        Parameters, SI; not finite where a run diverged.
    """
    constants, metres = np.zeros((CONSTANTS, LANES)), site.metres
    assumed = start = Rotation.from_matrix(np.moveaxis(record.attitude, -1, 0))
    nothing = np.empty((0, COUNT, LANES)), np.empty((0, OBSERVED, LANES))
    for number in range(estimator.passes):
        # the prior is centred on zero parameters and on the attitude assumed in the record
        from_prior = constants
        from_prior[COUNT:] = (start * assumed.inv()).as_rotvec().T
        state = np.empty((_ROWS, LANES))
        state[:COUNT] = constants[:COUNT]
        state[COUNT:CONSTANTS] = 0.0
        state[_NAV : _NAV + 9] = start.as_matrix().reshape(LANES, 9).T
        state[_NAV + navigation.VELOCITY : _NAV + navigation.POSITION] = record.velocity
        state[_NAV + navigation.POSITION :] = record.position / metres[:, None]
        begin = state[:CONSTANTS].copy()
        _run_pass(
            state,
            record.sensors,
            record.observations,
            motion.duration,
            motion.update_step,
            estimator.gains(number).gain,
            navigation.site_constants(site),
            metres,
            *(
                nothing
                if history is None
                else (history.estimate[number], history.innovation[number])
            ),
        )
        constants = state[:CONSTANTS]
        if number > 0:
            moved = _apply(estimator.translate, constants - begin)
            constants = begin + moved - _apply(estimator.pull, from_prior)
        # a diverged lane keeps its NaN among the parameters, but needs some attitude to go on with
        constants[COUNT:, ~np.isfinite(constants).all(axis=0)] = 0.0
        start = Rotation.from_rotvec(constants[COUNT:].T) * start
    return constants[:COUNT]


def _apply(matrix: np.ndarray, lanes: np.ndarray) -> np.ndarray:
    """Matrix product, lane by lane alike: a BLAS product rounds by the column's place."""
    return (matrix[:, :, None] * lanes).sum(axis=1)


@compiled
def _run_pass(
    start,
    sensors,
    observations,
    duration,
    update_step,
    gain,
    site,
    metres,
    estimate_history,
    innovation_history,
):
    """Navigate and correct all lanes through the record; `start` becomes the final state.

    Rows of the state: 27 parameters, attitude error at the start, attitude, velocity, position.
    The state lives in an array of fixed shape made here, so that the compiler knows that its rows
    do not overlap and keeps the lane loops free of run-time checks.
    """
    state = np.empty((_ROWS, LANES))
    innovation = np.empty((OBSERVED, LANES))
    correction = np.empty((NAVIGATION, LANES))
    for j in range(LANES):
        for i in range(_ROWS):
            state[i, j] = start[i, j]
    keep = len(estimate_history) > 0
    for k in range(len(update_step) - 1):
        _fetch(gain, k + _AHEAD, _GAIN_BYTES)
        _fetch(observations, k + _AHEAD, _STEP_BYTES)
        for s in range(update_step[k], update_step[k + 1]):
            _fetch(sensors, s + _AHEAD, _STEP_BYTES)
            _navigate(state, sensors, s, duration[s], site)
        _innovate(state, observations, k, metres, innovation)
        _correct(state, gain, k, innovation, correction, metres)
        if keep:
            for j in range(LANES):
                for i in range(COUNT):
                    estimate_history[k, i, j] = state[i, j]
                for i in range(OBSERVED):
                    innovation_history[k, i, j] = innovation[i, j]
    for j in range(LANES):
        for i in range(_ROWS):
            start[i, j] = state[i, j]


@inlined
def _fetch(array, row, row_bytes):
    """Ask for the cache lines of a row of an array; beyond its end that does nothing."""
    for line in range(0, row_bytes, CACHE_LINE):
        prefetch(array, row * row_bytes + line)  # type: ignore[call-arg]  # numba adds one


@inlined
def _navigate(state, sensors, s, dt, site):
    for j in range(LANES):
        angle = (sensors[s, 0, j], sensors[s, 1, j], sensors[s, 2, j])
        velocity = (sensors[s, 3, j], sensors[s, 4, j], sensors[s, 5, j])
        angle, velocity = compensate(state, j, angle, velocity, dt)
        advance(state, _NAV, j, angle, velocity, dt, site)


@inlined
def _innovate(state, observations, k, metres, innovation):
    for i in range(3):
        for j in range(LANES):
            innovation[i, j] = state[_NAV + 9 + i, j] - observations[k, i, j]
        for j in range(LANES):
            innovation[3 + i, j] = state[_NAV + 12 + i, j] * metres[i] - observations[k, 3 + i, j]


@inlined
def _correct(state, gain, k, innovation, correction, metres):
    """Feed back: navigation errors are navigated minus true, constants true minus estimated."""
    for i in range(NAVIGATION):
        for j in range(LANES):
            correction[i, j] = _product(gain, k, i, innovation, j)
    for i in range(CONSTANTS):
        for j in range(LANES):
            state[i, j] += _product(gain, k, NAVIGATION + i, innovation, j)
    for j in range(LANES):
        rotate_left(state, _NAV, j, (correction[0, j], correction[1, j], correction[2, j]))
    for i in range(3):
        for j in range(LANES):
            state[_NAV + 9 + i, j] -= correction[3 + i, j]
            state[_NAV + 12 + i, j] -= correction[6 + i, j] / metres[i]


@inlined
def _product(gain, k, row, innovation, j):
    return (
        gain[k, row, 0] * innovation[0, j]
        + gain[k, row, 1] * innovation[1, j]
        + gain[k, row, 2] * innovation[2, j]
        + gain[k, row, 3] * innovation[3, j]
        + gain[k, row, 4] * innovation[4, j]
        + gain[k, row, 5] * innovation[5, j]
    )
