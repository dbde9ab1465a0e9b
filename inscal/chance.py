"""What a consistent filter shows by chance: exact tests of its errors, and what they would miss.

The errors of a consistent filter are normal, with no mean and with the covariance that it claims
(Bar-Shalom, Li & Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, sec.
5.4). So their sums of squares are chi-square and counts of them binomial, at any number of runs.
A p-value here is two-sided unless it says otherwise: twice the smaller tail, one at most. It is
below a level exactly if the central interval of that confidence leaves out what is expected.

Many looks at once: each is held against the level over their number (Bonferroni). None of them is
below it in 1 - level of campaigns at least, however they depend on each other.
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from inscal.statistics import Bounded, central_tails, checked_errors


def chi_square_limits(dof: ArrayLike, confidence: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
    """Limits of a chi-square variable over its degrees of freedom, with equal tails.

    Parameters
    ----------
    dof : array_like
        Degrees of freedom, positive, whole or not.
    confidence : float

    Returns
    -------
    tuple of ndarray
    """
    half = np.asarray(dof, dtype=float) / 2.0  # chi-square is twice gamma of shape dof / 2
    low, high = (special.gammaincinv(half, tail) / half for tail in central_tails(confidence))
    return low, high


def chi_square_p(total: ArrayLike, dof: ArrayLike) -> np.ndarray:
    """Two-sided p-value of a sum of squares of unit normal numbers.

    Parameters
    ----------
    total : array_like
        Such as runs times the mean NEES, or runs times (RMSE over sigma) squared.
    dof : array_like
        Degrees of freedom: independent numbers squared.

    Returns
    -------
    ndarray
    """
    half, value = np.asarray(dof, dtype=float) / 2.0, np.asarray(total, dtype=float) / 2.0
    return 2.0 * np.minimum(special.gammainc(half, value), special.gammaincc(half, value))


def too_long_p(total: ArrayLike, dof: ArrayLike) -> np.ndarray:
    """One-sided p-value of a sum of squares, small where it is too large: of what should be nil."""
    return np.asarray(special.chdtrc(dof, total))


def student_p(t: ArrayLike, dof: ArrayLike) -> np.ndarray:
    """Two-sided p-value of Student's t: a mean over its estimated standard error."""
    return np.asarray(2.0 * special.stdtr(dof, -np.abs(t)))


def binomial_p(successes: ArrayLike, trials: ArrayLike, share: ArrayLike) -> np.ndarray:
    """Two-sided p-value of a count.

    Parameters
    ----------
    successes, trials : array_like
    share : array_like
        Probability of a success.

    Returns
    -------
    ndarray
        Below a level exactly where `clopper_pearson` of that confidence leaves out `share`.
    """
    hits, n = np.asarray(successes, dtype=float), np.asarray(trials, dtype=int)
    # bdtrc of -1, the probability of any count at all, is one
    tails = special.bdtr(hits, n, share), special.bdtrc(hits - 1.0, n, share)
    return np.minimum(2.0 * np.minimum(*tails), 1.0)


def clopper_pearson(successes: ArrayLike, trials: ArrayLike, confidence: float = 0.95) -> Bounded:
    """Share of successes and its exact interval.

    Parameters
    ----------
    successes, trials : array_like
        Counts of any shapes that broadcast, 0 <= successes <= trials, trials > 0.
    confidence : float

    Returns
    -------
    Bounded
        successes / trials and the interval, of the broadcast shape.

    Notes
    -----
    Clopper & Pearson (1934), Biometrika 26:404-413, by quantiles of the beta distribution: it
    misses a share in at most (1 - confidence) / 2 of cases on either side. Wilson's interval is
    shorter, and on average as good; near 0 and 1 it misses several times as often as it says.
    """
    hits, n = np.broadcast_arrays(np.asarray(successes, float), np.asarray(trials, float))
    low, high = central_tails(confidence)
    # with no success, or no failure, the beta distribution shrinks to a point
    lower = np.where(hits > 0, special.betaincinv(np.maximum(hits, 1), n - hits + 1, low), 0.0)
    upper = np.where(hits < n, special.betaincinv(hits + 1, np.maximum(n - hits, 1), high), 1.0)
    return Bounded(hits / n, lower, upper)


def rmse_of_normal(error: ArrayLike, confidence: float = 0.95) -> Bounded:
    """Root mean square of normal errors without a mean, and its exact confidence interval.

    Parameters
    ----------
    error : array_like, shape (runs, parameters)
    confidence : float

    Returns
    -------
    Bounded
        In the unit of the errors, shape (parameters,). Of errors that may be of another
        distribution see `inscal.statistics.rmse`.
    """
    values = checked_errors(error)
    value = np.sqrt(np.square(values).mean(axis=0))
    low, high = chi_square_limits(len(values), confidence)
    return Bounded(value, value / np.sqrt(high), value / np.sqrt(low))


def distribution_p(values: ArrayLike, dof: int) -> float:
    """p-value of the hypothesis that values are chi-square, by their largest deviation.

    Parameters
    ----------
    values : array_like, shape (runs,)
        Independent, such as the NEES of every run.
    dof : int
        Degrees of freedom.

    Returns
    -------
    float

    Notes
    -----
    Kolmogorov and Smirnov's test with Stephens' correction for small samples (Stephens, 1970,
    Journal of the Royal Statistical Society B 32:115-122).
    """
    ordered = special.gammainc(dof / 2.0, np.sort(np.asarray(values, dtype=float)) / 2.0)
    runs = len(ordered)
    steps = np.arange(runs + 1) / runs
    distance = max(np.max(steps[1:] - ordered), np.max(ordered - steps[:-1]))
    root = np.sqrt(runs)
    return float(special.kolmogorov(distance * (root + 0.12 + 0.11 / root)))


def scale_power(dof: float, too_small: float, level: float) -> float:
    """Probability that a chi-square look finds claimed sigmas too small.

    Parameters
    ----------
    dof : float
        Numbers squared: runs for one sigma, runs times parameters for the mean NEES.
    too_small : float
        Share of the true sigma that the claimed one lacks: 0.05 where it claims 95 %.
    level : float
        Of the p-value, over the number of looks.

    Returns
    -------
    float
    """
    half = dof / 2.0
    low, high = (half * (1.0 - too_small) ** 2 * x for x in chi_square_limits(dof, 1.0 - level))
    return float(special.gammainc(half, low) + special.gammaincc(half, high))


def smallest_seen(dof: float, level: float, power: float) -> float:
    """Smallest lack of claimed sigmas that a chi-square look finds often enough.

    Parameters
    ----------
    dof, level : float
        As of `scale_power`.
    power : float
        Share of campaigns in which it is to be found.

    Returns
    -------
    float
        As `too_small` of `scale_power`. Finding them too small by chance when they are too large
        is left out, which is nothing for any useful power.
    """
    half = dof / 2.0
    critical = special.gammainccinv(half, level / 2.0)
    return float(1.0 - np.sqrt(special.gammaincinv(half, 1.0 - power) / critical))
