"""The closed-loop calibrator: strapdown navigation, shared gains, one or more passes.

A run is navigated and corrected at every update (`inscal.closed_loop`), with gains that are the
same for all runs; nothing of the covariance is computed per run.

How several passes over one record connect is the subject of `inscal.estimator`, how many a run
needs that of `inscal.convergence`.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from inscal import convergence, navigation
from inscal.closed_loop import NAV, ROWS, run_pass
from inscal.estimator import CONSTANTS, Estimator
from inscal.kernel import LANES
from inscal.motion import Motion, Site
from inscal.parameters import COUNT
from inscal.record import OBSERVED, Record
from inscal.recursion import ATTITUDE


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

    Either may have no room for updates, and is not kept then.
    """

    estimate: np.ndarray
    innovation: np.ndarray


def empty_history(passes: int, updates: int, *, estimates: bool = True) -> History:
    """Room for the course of `passes` passes, of innovations alone if told so."""
    return History(
        np.empty((passes, updates if estimates else 0, COUNT, LANES)),
        np.empty((passes, updates, OBSERVED, LANES)),
    )


@dataclass(frozen=True)
class Calibration:
    """What comes of `LANES` records.

    Attributes
    ----------
    estimate : ndarray, shape (27, LANES)
        Parameters, SI.
    augmented : ndarray, shape (n, LANES)
        Augmented states that do not wander, SI.
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
    augmented: np.ndarray
    passes: np.ndarray
    reason: np.ndarray
    innovation_ratio: np.ndarray

    def head(self, count: int) -> "Calibration":
        """First lanes alone."""
        return Calibration(
            self.estimate[:, :count],
            self.augmented[:, :count],
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
    further = len(estimator.per_sigma) - CONSTANTS
    lanes = _Lanes(np.zeros((COUNT, LANES)), assumed, np.zeros((further, LANES)))
    for number in range(estimator.max_passes):
        begin = np.concatenate([lanes.parameter, np.zeros((ATTITUDE, LANES)), lanes.augmented])
        # the prior is centred on zero parameters and on the attitude assumed in the record
        turned = (lanes.attitude * assumed.inv()).as_rotvec().T
        off_prior = np.concatenate([lanes.parameter, turned, lanes.augmented])
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
    augmented : ndarray, shape (n, LANES)
        Augmented states that do not wander.
    going : ndarray of bool, shape (LANES,)
        Lanes that make the next pass. The others are left as they are.
    """

    def __init__(self, parameter: np.ndarray, attitude: Rotation, augmented: np.ndarray):
        self.parameter, self.attitude, self.augmented = parameter, attitude, augmented
        self.going = np.ones(LANES, dtype=bool)
        self._fresh = np.ones(LANES, dtype=bool)  # has not started anew yet
        self._passes = np.zeros(LANES, dtype=np.int64)
        self._reason = np.zeros(LANES, dtype=np.int8)
        self._ratio = np.full(LANES, np.nan)

    def take(self, result: np.ndarray) -> None:
        """Go on from the constants that a pass has found, shape (30 + n, LANES)."""
        self._passes += self.going
        # a lane that ran away shows it in every parameter, but needs some attitude to go on with
        finite = _finite(result)
        result = np.where(finite, result, np.nan)
        self.parameter = np.where(self.going, result[:COUNT], self.parameter)
        self.augmented = np.where(self.going, result[CONSTANTS:], self.augmented)
        turned = np.where(self.going & finite, result[COUNT:CONSTANTS], 0.0)
        self.attitude = Rotation.from_rotvec(turned.T) * self.attitude

    def start_anew(self, assumed: Rotation) -> None:
        """Put lanes whose pass ran away back to the prior's mean, once; stop them the next time."""
        lost = self.going & ~_finite(self.parameter)
        if lost.any():
            anew = lost & self._fresh
            self.parameter[:, anew] = 0.0
            self.augmented[:, anew] = 0.0
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
        return Calibration(self.parameter, self.augmented, self._passes, self._reason, self._ratio)


def _finite(lanes: np.ndarray) -> np.ndarray:
    return np.asarray(np.isfinite(lanes).all(axis=0))


def _pass(record, motion, site, estimator, number, lanes, history):
    """One pass over the record: constants as it has them, (c, LANES), and the sum of its NIS."""
    metres, nis = site.metres, np.zeros(LANES)
    state = np.empty((ROWS, LANES))
    state[:COUNT] = lanes.parameter
    state[COUNT:CONSTANTS] = 0.0
    state[NAV : NAV + 9] = lanes.attitude.as_matrix().reshape(LANES, 9).T
    state[NAV + navigation.VELOCITY : NAV + navigation.POSITION] = record.velocity
    state[NAV + navigation.POSITION :] = record.position / metres[:, None]
    gains = estimator.gains(number)
    judged = estimator.judged and number + 1 >= estimator.passes
    about, further = estimator.augmented, None
    if about is not None:
        wandering = np.zeros((about.transitions.wandering, LANES))  # of mean zero, in every pass
        further = np.concatenate([lanes.augmented, wandering]), about.rows, about.decay
    course = np.empty((0, COUNT, LANES)), np.empty((0, OBSERVED, LANES))
    if history is not None and number < len(history.estimate):
        course = history.estimate[number], history.innovation[number]
    run_pass(
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
        further,
    )
    constants = state[:CONSTANTS]
    if further is not None:
        constants = np.concatenate([constants, further[0][: len(lanes.augmented)]])
    return constants, nis


def _apply(matrix: np.ndarray, lanes: np.ndarray) -> np.ndarray:
    """Matrix product, lane by lane alike: a BLAS product rounds by the column's place."""
    return (matrix[:, :, None] * lanes).sum(axis=1)
