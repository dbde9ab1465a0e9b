"""The closed-loop calibrator: strapdown navigation, shared gains, one or more passes.

A run is navigated with compensated increments; at every update the six differences between
navigated and observed velocity and position, times the gains of `inscal.recursion`, correct all
states at once. Nothing of the covariance is computed per run.

How several passes over one record connect is the subject of `inscal.estimator`, how many a run
needs that of `inscal.convergence`.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from inscal import convergence, navigation
from inscal.estimator import CONSTANTS, Estimator
from inscal.kernel import CACHE_LINE, LANES, compiled, inlined, prefetch
from inscal.motion import Motion, Site
from inscal.navigation import advance, rotate_left, straightened
from inscal.parameters import COUNT
from inscal.record import OBSERVED, Record
from inscal.recursion import ATTITUDE
from inscal.sensor import compensate, compensate_in_ramp
from inscal.state_model import NAVIGATION

_NAV = CONSTANTS
_ROWS = _NAV + navigation.ROWS
_STEP_BYTES = 8 * 6 * LANES
_GAIN_BYTES = 8 * OBSERVED * (NAVIGATION + CONSTANTS)
_WHITENING_BYTES = 8 * OBSERVED * OBSERVED
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


@dataclass(frozen=True)
class Calibration:
    """What comes of `LANES` records.

    Attributes
    ----------
    estimate : ndarray, shape (27, LANES)
        Parameters, SI.
    passes : ndarray of int, shape (LANES,)
        Passes made, that after which a run started anew included.
    reason : ndarray of int, shape (LANES,)
        Why a run failed, a number of `inscal.convergence.REASONS`; 0 where it did not. Estimates
        may be not finite where it did.
    innovation_ratio : ndarray, shape (LANES,)
        Of the last pass, 1 where the filter is right (`inscal.convergence.innovation_ratio`); NaN
        where runs are not judged, or did not converge.
    """

    estimate: np.ndarray
    passes: np.ndarray
    reason: np.ndarray
    innovation_ratio: np.ndarray

    def head(self, count: int) -> "Calibration":
        """First lanes alone."""
        return Calibration(
            self.estimate[:, :count],
            self.passes[:count],
            self.reason[:count],
            self.innovation_ratio[:count],
        )


def calibrate(
    record: Record,
    motion: Motion,
    site: Site,
    estimator: Estimator,
    *,
    history: History | None = None,
) -> Calibration:
    """Estimate the sensor parameters of `LANES` runs.

    Parameters
    ----------
    record : Record
    motion : Motion
        Only its step lengths, update times and the planned shape of ramps are used.
    site : Site
    estimator : Estimator
    history : History, optional
        Filled with the course of the first passes, as many as it has room for. In a lane that made
        fewer, the rest means nothing.

    Returns
    -------
    Calibration
    """
    assumed = Rotation.from_matrix(np.moveaxis(record.attitude, -1, 0))
    lanes = _Lanes(np.zeros((COUNT, LANES)), assumed)
    for number in range(estimator.max_passes):
        begin = np.concatenate([lanes.parameter, np.zeros((ATTITUDE, LANES))])
        # the prior is centred on zero parameters and on the attitude assumed in the record
        off_prior = np.concatenate(
            [lanes.parameter, (lanes.attitude * assumed.inv()).as_rotvec().T]
        )
        result, nis = _pass(record, motion, site, estimator, number, lanes, history)
        tight_step = result - begin
        if number == 0:
            step, tight_step = tight_step, np.zeros_like(begin)
        else:
            moved = _apply(estimator.translate, tight_step)
            result = begin + moved - _apply(estimator.pull, off_prior)
            step = result - begin
        lanes.take(result)
        if estimator.judged:
            lanes.start_anew(assumed)
            if number + 1 >= estimator.passes:
                converged = convergence.have_converged(estimator, number + 1, step, result)
                ratio = convergence.innovation_ratio(estimator, nis, tight_step, step)
                lanes.stop(converged, ratio, estimator.innovation_limit)
            if not lanes.going.any():
                break
    return lanes.finish(estimator.judged)


class _Lanes:
    """Where the runs of a tile stand between two passes; what a lane does concerns no other.

    Attributes
    ----------
    parameter : ndarray, shape (27, LANES)
    attitude : Rotation
        Body to NED at the start, as far as known.
    going : ndarray of bool, shape (LANES,)
        Lanes that make the next pass. The others are left as they are.
    """

    def __init__(self, parameter: np.ndarray, attitude: Rotation):
        self.parameter, self.attitude = parameter, attitude
        self.going = np.ones(LANES, dtype=bool)
        self._fresh = np.ones(LANES, dtype=bool)  # has not started anew yet
        self._passes = np.zeros(LANES, dtype=np.int64)
        self._reason = np.zeros(LANES, dtype=np.int8)
        self._ratio = np.full(LANES, np.nan)

    def take(self, result: np.ndarray) -> None:
        """Go on from the constants that a pass has found, shape (30, LANES)."""
        self._passes += self.going
        # a lane that ran away shows it in every parameter, but needs some attitude to go on with
        finite = _finite(result)
        result = np.where(finite, result, np.nan)
        self.parameter = np.where(self.going, result[:COUNT], self.parameter)
        turned = np.where(self.going & finite, result[COUNT:], 0.0)
        self.attitude = Rotation.from_rotvec(turned.T) * self.attitude

    def start_anew(self, assumed: Rotation) -> None:
        """Put lanes whose pass ran away back to the prior's mean, once; stop them the next time."""
        lost = self.going & ~_finite(self.parameter)
        if lost.any():
            anew = lost & self._fresh
            self.parameter[:, anew] = 0.0
            self.attitude[anew] = assumed[anew]  # and no other is as much as normalised again
            self.going &= ~lost | anew
            self._fresh &= ~lost

    def stop(self, converged: np.ndarray, ratio: np.ndarray, limit: float) -> None:
        """Keep lanes that have converged as they are; those of a ratio beyond the limit failed."""
        done = self.going & converged
        self._ratio[done] = ratio[done]
        self._reason[done & ~(ratio <= limit)] = convergence.BEYOND_LIMIT
        self.going &= ~converged

    def finish(self, judged: bool) -> Calibration:
        """Outcome of the lanes after the last pass."""
        if judged:
            self._reason[self.going] = convergence.NOT_CONVERGED
        self._reason[~_finite(self.parameter)] = convergence.NOT_FINITE
        return Calibration(self.parameter, self._passes, self._reason, self._ratio)


def _finite(lanes: np.ndarray) -> np.ndarray:
    return np.asarray(np.isfinite(lanes).all(axis=0))


def _pass(record, motion, site, estimator, number, lanes, history):
    """One pass over the record: constants as it has them, (30, LANES), and the sum of its NIS."""
    metres, nis = site.metres, np.zeros(LANES)
    state = np.empty((_ROWS, LANES))
    state[:COUNT] = lanes.parameter
    state[COUNT:CONSTANTS] = 0.0
    state[_NAV : _NAV + 9] = lanes.attitude.as_matrix().reshape(LANES, 9).T
    state[_NAV + navigation.VELOCITY : _NAV + navigation.POSITION] = record.velocity
    state[_NAV + navigation.POSITION :] = record.position / metres[:, None]
    gains = estimator.gains(number)
    judged = estimator.judged and number + 1 >= estimator.passes
    course = np.empty((0, COUNT, LANES)), np.empty((0, OBSERVED, LANES))
    if history is not None and number < len(history.estimate):
        course = history.estimate[number], history.innovation[number]
    _run_pass(
        state,
        record.sensors,
        record.observations,
        motion.duration,
        motion.ramp_terms,
        motion.update_step,
        gains.gain,
        gains.whitening if judged else gains.whitening[:0],
        navigation.site_constants(site),
        metres,
        *course,
        nis,
    )
    return state[:CONSTANTS], nis


def _apply(matrix: np.ndarray, lanes: np.ndarray) -> np.ndarray:
    """Matrix product, lane by lane alike: a BLAS product rounds by the column's place."""
    return (matrix[:, :, None] * lanes).sum(axis=1)


@compiled
def _run_pass(
    start,
    sensors,
    observations,
    duration,
    ramp_terms,
    update_step,
    gain,
    whitening,
    site,
    metres,
    estimate_history,
    innovation_history,
    nis,
):
    """Navigate and correct all lanes through the record; `start` becomes the final state.

    Where `whitening` is given, `nis` becomes the sum of the normalised innovations squared.

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
    keep, judge = len(estimate_history) > 0, len(whitening) > 0
    squares = np.zeros(LANES)
    for k in range(len(update_step) - 1):
        _fetch(gain, k + _AHEAD, _GAIN_BYTES)
        _fetch(observations, k + _AHEAD, _STEP_BYTES)
        for s in range(update_step[k], update_step[k + 1]):
            _fetch(sensors, s + _AHEAD, _STEP_BYTES)
            if ramp_terms[s, 0] == 0.0:
                _navigate(state, sensors, s, duration[s], site)
            else:
                _navigate_ramp(state, sensors, s, duration[s], site, ramp_terms)
        _innovate(state, observations, k, metres, innovation)
        if judge:
            _fetch(whitening, k + _AHEAD, _WHITENING_BYTES)
            for j in range(LANES):
                squares[j] += _squared(whitening, k, innovation, j)
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
        nis[j] = squares[j]


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
def _navigate_ramp(state, sensors, s, dt, site, terms):
    for j in range(LANES):
        angle = (sensors[s, 0, j], sensors[s, 1, j], sensors[s, 2, j])
        velocity = (sensors[s, 3, j], sensors[s, 4, j], sensors[s, 5, j])
        angle, velocity = compensate_in_ramp(state, j, angle, velocity, dt, terms[s, 0])
        angle, velocity = straightened(state, _NAV, j, angle, velocity, dt, site, terms, s)
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


@inlined
def _squared(whitening, k, innovation, j):
    """Normalised innovation squared: of the six, whitened by a lower triangular matrix."""
    total = 0.0
    for i in range(OBSERVED):
        unit = 0.0
        for c in range(i + 1):
            unit += whitening[k, i, c] * innovation[c, j]
        total += unit * unit
    return total
