"""Paired comparison of the errors of two campaigns, on plain arrays.

Row i of both error arrays, shape (runs, parameters), is the same simulated run treated in two
ways. What the two share (truth, noise) cancels in a comparison that keeps the pairs together.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from inscal.statistics import central_tails, checked_errors

_BLOCK_WEIGHTS = 2_000_000
# Resampling weights held at once (16 MB as floats).

_ROUNDING = 1e-12
# A log ratio with a standard error below this is constant; what is left is rounding.


@dataclass(frozen=True)
class RmseRatio:
    """RMSE of a over RMSE of b, each array of shape (parameters,), pure numbers.

    Attributes
    ----------
    ratio : ndarray
        The ratio over the paired runs.
    lower, upper : ndarray
        Pointwise interval: holds each parameter's ratio at the stated confidence.
    simultaneous_lower, simultaneous_upper : ndarray
        Holds the ratios of all parameters at once at the stated confidence.
    """

    ratio: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    simultaneous_lower: np.ndarray
    simultaneous_upper: np.ndarray


@dataclass(frozen=True)
class ShareDifference:
    """Share of runs that keep all bounds in a less that in b, of paired runs.

    Attributes
    ----------
    a, b : float
        The shares.
    difference : float
        Of a less b.
    lower, upper : float
        Its interval.
    """

    a: float
    b: float
    difference: float
    lower: float
    upper: float


def share_difference(
    kept_a: ArrayLike, kept_b: ArrayLike, confidence: float = 0.95
) -> ShareDifference:
    """Difference of two shares of paired runs.

    Half a run added to each of the four outcomes makes Wald's interval honest for few runs and for
    shares near one (Agresti and Min, Simple improved confidence intervals for comparing matched
    proportions, Statistics in Medicine 24, 2005).

    Parameters
    ----------
    kept_a, kept_b : array_like of bool, shape (runs,)
        Whether the run keeps all bounds.
    confidence : float

    Returns
    -------
    ShareDifference
    """
    a, b = np.asarray(kept_a, dtype=bool), np.asarray(kept_b, dtype=bool)
    runs, only_a, only_b = len(a), np.sum(a & ~b) + 0.5, np.sum(b & ~a) + 0.5
    middle = (only_a - only_b) / (runs + 2.0)
    spread = np.sqrt((only_a + only_b) / (runs + 2.0) - middle**2) / np.sqrt(runs + 2.0)
    reach = special.ndtri(0.5 + 0.5 * confidence) * spread
    return ShareDifference(
        a=float(a.mean()),
        b=float(b.mean()),
        difference=float(a.mean() - b.mean()),
        lower=float(max(middle - reach, -1.0)),
        upper=float(min(middle + reach, 1.0)),
    )


def rmse_ratio(
    error_a: ArrayLike,
    error_b: ArrayLike,
    *,
    resamples: int,
    rng: np.random.Generator,
    confidence: float = 0.95,
) -> RmseRatio:
    """Ratio RMSE of a / RMSE of b of paired runs, with bootstrap intervals.

    Parameters
    ----------
    error_a, error_b : array_like, shape (runs, parameters)
        Errors of the same runs in the same unit, not all zero in any parameter.
    resamples : int
        Bootstrap resamples; 2000 or more for 95 %.
    rng : numpy.random.Generator
    confidence : float

    Returns
    -------
    RmseRatio

    Raises
    ------
    ValueError
        If the shapes differ, there are fewer than two runs or resamples, or as
        `inscal.statistics.checked_errors` and `inscal.statistics.central_tails`.

    Notes
    -----
    Whole runs are resampled, so that pairs and the correlation between parameters stay. The
    pointwise interval is the percentile interval (Efron & Tibshirani, 1993, An Introduction to
    the Bootstrap, ch. 13). The simultaneous one is log ratio +- c se, with c the quantile of the
    largest studentised deviation over the parameters (max-t: Westfall & Young, 1993, Resampling-
    Based Multiple Testing, ch. 2; studentised bootstrap: Davison & Hinkley, 1997, Bootstrap
    Methods and their Application, sec. 5.2). It is studentised by the se of each resample because
    with one se for all it holds less than it claims (92 % for 95 % at 100 runs, 27 parameters).
    Measured with that, of 1 000 and 1 500 campaigns for two pairs of filters: all 27 hold in 94.5
    to 95.9 % at 500 runs (standard error 0.6), 95.2 % at 100 and 97.9 % at 32.
    """
    square_a, square_b = (np.square(e) for e in _checked_pair(error_a, error_b))
    if resamples < 2:
        raise ValueError(f"{resamples} resamples; at least 2 are needed")
    tails = central_tails(confidence)
    mean_a, mean_b = square_a.mean(axis=0), square_b.mean(axis=0)
    ratio = np.sqrt(mean_a / mean_b)
    difference = square_a / mean_a - square_b / mean_b
    deviation, deviation_se = _resampled(square_b / mean_b, difference, resamples, rng)
    lower, upper = ratio * np.exp(np.quantile(deviation, tails, axis=0))

    se = 0.5 * np.sqrt(np.square(difference).mean(axis=0) / len(difference))
    # A parameter the treatments leave alone has one ratio in every resample: it takes no part.
    varies = se > _ROUNDING
    t = np.full((resamples, varies.sum()), np.inf)
    # Of very few runs a resample may draw one alone, which says nothing of the scatter: t stays
    # infinite, and the interval is as wide as it must be.
    spread = deviation_se[:, varies]
    np.divide(np.abs(deviation[:, varies]), spread, out=t, where=spread > _ROUNDING)
    critical = np.quantile(t.max(axis=1, initial=0.0), confidence, method="higher")
    half = np.multiply(critical, se, out=np.zeros_like(se), where=varies)
    with np.errstate(over="ignore"):
        factor = np.exp(half)
    return RmseRatio(ratio, lower, upper, ratio / factor, ratio * factor)


def p_value_ratio_above_one(error_a: ArrayLike, error_b: ArrayLike) -> np.ndarray:
    """One-sided p-value per parameter against "the RMSE of a is no larger than that of b".

    Parameters
    ----------
    error_a, error_b : array_like, shape (runs, parameters)
        Errors of the same runs in the same unit.

    Returns
    -------
    ndarray, shape (parameters,)
        Small where a is worse; 1 where a and b have the same |error| in every run. Correct with
        `holm` before reading many at once.

    Raises
    ------
    ValueError
        If the shapes differ, there are fewer than two runs, or as
        `inscal.statistics.checked_errors`.

    Notes
    -----
    Paired t test on the squared errors, of which the mean square errors are the means. It needs
    the mean of the differences to be near normal, not the errors themselves.
    """
    square_a, square_b = (np.square(e) for e in _checked_pair(error_a, error_b))
    p = np.ones(square_a.shape[1])
    differs = (square_a != square_b).any(axis=0)
    # `scipy.stats.ttest_rel` does the same, and takes half a second to import
    difference, n = square_a[:, differs] - square_b[:, differs], len(square_a)
    mean = difference.mean(axis=0)
    variance = np.square(difference - mean).mean(axis=0) * (n / (n - 1))
    with np.errstate(divide="ignore"):  # differences all alike leave no doubt
        t = mean / np.sqrt(variance / n)
    p[differs] = special.stdtr(n - 1, -t)
    return p


def holm(p_values: ArrayLike) -> np.ndarray:
    """Holm-adjusted p-values.

    Parameters
    ----------
    p_values : array_like, shape (tests,)

    Returns
    -------
    ndarray, shape (tests,)
        Reject where the adjusted value is at most alpha: the probability of any false rejection
        is then at most alpha, whatever the dependence between the tests.

    Raises
    ------
    ValueError
        If a value is not a probability.

    Notes
    -----
    Holm (1979), Scandinavian Journal of Statistics 6:65-70.
    """
    p = np.asarray(p_values, dtype=float)
    if not ((p >= 0.0) & (p <= 1.0)).all():
        raise ValueError("p-values must lie between 0 and 1")
    order = np.argsort(p)
    adjusted = np.empty_like(p)
    adjusted[order] = np.maximum.accumulate(np.arange(p.size, 0, -1) * p[order])
    return np.minimum(adjusted, 1.0)


def _checked_pair(error_a: ArrayLike, error_b: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    a, b = checked_errors(error_a), checked_errors(error_b)
    if a.shape != b.shape:
        raise ValueError(f"paired errors have different shapes, {a.shape} and {b.shape}")
    if len(a) < 2:
        raise ValueError("a paired comparison needs at least two runs")
    return a, b


def _resampled(
    base: np.ndarray, difference: np.ndarray, resamples: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Log RMSE ratios of bootstrap resamples of the runs, and their delta-method standard errors.

    `base` holds the squared errors of b over their mean, `difference` those of a over theirs
    minus `base`. Working on the difference keeps the digits where a and b nearly agree. Both
    results have shape (resamples, parameters); the log ratio is relative to that of all runs.
    """
    runs, parameters = base.shape
    columns = np.hstack(
        [base, difference, np.square(base), base * difference, np.square(difference)]
    )
    log_ratio, se = np.empty((resamples, parameters)), np.empty((resamples, parameters))
    block = max(1, _BLOCK_WEIGHTS // runs)
    for start in range(0, resamples, block):
        rows = slice(start, min(start + block, resamples))
        # How often each run is drawn is all a mean needs, and turns resampling into a product.
        drawn = rng.multinomial(runs, np.full(runs, 1.0 / runs), size=rows.stop - start)
        b, d, bb, bd, dd = np.split((drawn / runs) @ columns, 5, axis=1)
        log_ratio[rows] = 0.5 * np.log1p(d / b)
        # Influence of a run on the log ratio: (its a / mean a - its b / mean b) / 2.
        influence_square = (dd - 2.0 * d / b * bd + np.square(d / b) * bb) / np.square(b + d)
        se[rows] = 0.5 * np.sqrt(np.maximum(influence_square, 0.0) / runs)
    return log_ratio, se
