"""Innovations of simulated calibrations against the covariance the filter predicts for them.

If a filter is optimal its innovations are white with the predicted covariance (Bar-Shalom, Li &
Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, sec. 5.4). Here every
innovation is divided by the Cholesky factor of its predicted covariance, which makes an optimal
filter's six unit white sequences; the squared length of the six is the normalised innovation
squared (NIS).

A later pass starts from a result that its record has already led to (`inscal.estimator`). Its
innovations are residuals of a fit: every constant takes one unit of NIS, over the whole record, or
as much less as the prior still tells of it (`units_told`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inscal.calibrator import empty_history
from inscal.chance import clopper_pearson
from inscal.estimator import Estimator
from inscal.experiment import Experiment, tiles
from inscal.parameters import COUNT
from inscal.record import OBSERVED
from inscal.statistics import Bounded, checked_errors, normal_quantile


@dataclass(frozen=True)
class InnovationStatistics:
    """Innovation statistics of some runs, by pass.

    Attributes
    ----------
    nis : ndarray, shape (passes, updates, runs)
    autocorrelation : ndarray, shape (passes, stretches, lags, 6, runs)
        Of the six unit sequences, over each stretch of the record.
    truth, estimate, first_estimate : ndarray, shape (runs, 27)
        True parameters, the estimates, and those after the first pass alone; SI.
    """

    nis: np.ndarray
    autocorrelation: np.ndarray
    truth: np.ndarray
    estimate: np.ndarray
    first_estimate: np.ndarray


def innovation_statistics(
    experiment: Experiment, runs: Sequence[int], stretches: Sequence[slice], lags: Sequence[int]
) -> InnovationStatistics:
    """Repeat runs and keep the statistics of their innovations.

    Parameters
    ----------
    experiment : Experiment
    runs : sequence of int
        Run numbers, none of which may diverge.
    stretches : sequence of slice
        Of update numbers.
    lags : sequence of int
        In updates; each shorter than every stretch.

    Returns
    -------
    InnovationStatistics
    """
    passes, updates = experiment.estimator.passes, experiment.motion.updates
    history = empty_history(passes, updates)
    covariance = [experiment.estimator.gains(p).innovation_covariance for p in range(passes)]
    result = InnovationStatistics(
        np.empty((passes, updates, len(runs))),
        np.empty((passes, len(stretches), len(lags), OBSERVED, len(runs))),
        *(np.empty((len(runs), COUNT)) for _ in range(3)),
    )
    for part, truth, calibration in tiles(experiment, runs, history=history):
        used = len(truth)
        result.truth[part], result.estimate[part] = truth, calibration.estimate.T
        result.first_estimate[part] = history.estimate[0, -1].T[:used]
        for number in range(passes):
            unit = whiten(history.innovation[number, :, :, :used], covariance[number])
            result.nis[number, :, part] = np.square(unit).sum(axis=1)
            for place, stretch in enumerate(stretches):
                result.autocorrelation[number, place, ..., part] = _autocorrelation(
                    unit[stretch], lags
                )
    return result


def units_told(estimator: Estimator, number: int) -> float:
    """Units of NIS that a run's pass lacks, because its start was fitted to the same record.

    Parameters
    ----------
    estimator : Estimator
    number : int
        Of the pass, counted from 0.

    Returns
    -------
    float
        Zero in the first pass; later the trace of I - P P_0^-1 over the constants modelled.

    Notes
    -----
    With y = H x + v, v of covariance R, and the estimate x0 of the prior (m, P_0), what that leaves
    of the record is y - H x0 = R S^-1 (y - H m), S = H P_0 H^T + R. Its squared length in R is on
    average the trace of R S^-1: the number of observations less the trace of K H = I - P P_0^-1.
    A tight prior about x0 instead changes that by the pull of (m, P_0), squared: a share P P_0^-1
    of a unit at most, neglected.
    """
    if number == 0:
        return 0.0
    return float((estimator.per_sigma > 0.0).sum() - np.trace(estimator.pull))


def whiten(innovation: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Unit sequences: innovations over the Cholesky factors of their predicted covariances.

    Parameters
    ----------
    innovation : ndarray, shape (updates, m, runs)
    covariance : ndarray, shape (updates, m, m)

    Returns
    -------
    ndarray, shape (updates, m, runs)
        White with unit covariance if the filter is optimal.
    """
    return np.linalg.inv(np.linalg.cholesky(covariance)) @ innovation


def autocorrelation(innovation: ArrayLike, lags: Sequence[int]) -> np.ndarray:
    """Time-average autocorrelation of an innovation sequence by component (Bar-Shalom et al.).

    Parameters
    ----------
    innovation : array_like, shape (updates, m)
        Not all zero in any component. The mean is not taken out: innovations should have none.
    lags : sequence of int
        Each from 1 to updates - 1.

    Returns
    -------
    ndarray, shape (lags, m)
        Between -1 and 1; within `white_band` for 95 of 100 lags if the innovations are white.

    Raises
    ------
    ValueError
        If a lag is out of range.
    """
    values = checked_errors(innovation)
    out = np.empty((len(lags), values.shape[1]))
    for row, lag in enumerate(lags):
        if not 1 <= lag < len(values):
            raise ValueError(f"lag {lag} does not lie between 1 and {len(values) - 1}")
        early, late = values[:-lag], values[lag:]
        power = np.square(early).sum(axis=0) * np.square(late).sum(axis=0)
        out[row] = (early * late).sum(axis=0) / np.sqrt(power)
    return out


def white_band(updates: int, confidence: float = 0.95) -> float:
    """Half-width of the band of a white sequence's autocorrelation (Bar-Shalom et al.).

    By normal approximation 1.96 / sqrt(updates) at 95 %, for lags far below `updates`.
    """
    return float(normal_quantile(confidence) / np.sqrt(updates))


def _autocorrelation(unit: np.ndarray, lags: Sequence[int]) -> np.ndarray:
    """Autocorrelation of unit sequences (updates, m, runs), shape (lags, m, runs)."""
    return autocorrelation(unit.reshape(len(unit), -1), lags).reshape(len(lags), *unit.shape[1:])


def share_beyond_band(
    correlation: np.ndarray,
    updates: int,
    lags: Sequence[int],
    *,
    band: float = 0.95,
    confidence: float = 0.99,
) -> Bounded:
    """Share of autocorrelations outside the band of a white sequence.

    Parameters
    ----------
    correlation : ndarray, shape (lags, ...)
    updates : int
        Length of each sequence.
    lags : sequence of int
        Far below `updates`.
    band : float
        Share inside the band if the sequences are white.
    confidence : float
        Of the interval. It takes the correlations as independent, as those of white sequences are
        but for terms of 1 / updates.

    Returns
    -------
    Bounded
        To be held against 1 - band.
    """
    # a correlation at lag k is one of updates - k pairs
    limit = np.array([white_band(updates - lag, band) for lag in lags])
    beyond = np.abs(correlation) > limit.reshape(-1, *[1] * (correlation.ndim - 1))
    return clopper_pearson(beyond.sum(), beyond.size, confidence)
