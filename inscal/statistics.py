"""Statistics of estimation errors over Monte Carlo runs, on plain arrays.

An error array has shape (runs, parameters), one row per run, and every function is vectorised
over the parameters. An error statistic is in the unit of its errors, whatever that is; shares,
NEES and NIS are pure numbers. A function of errors raises `ValueError` where `checked_errors`
does, a function of a confidence where `central_tails` does; further errors are listed with it.

Paired comparison of two campaigns is in `inscal.comparison_statistics`, the labelled layer in
`inscal.summary`. Sources, by name below:

- Morris, White & Crowther (2019), Statistics in Medicine 38:2074-2102, Table 6: statistics with
  their Monte Carlo standard error ("MCSE"), by which they would scatter between campaigns.
- Bar-Shalom, Li & Kirubarajan (2001), Estimation with Applications to Tracking and Navigation,
  sec. 5.4: consistency of a filter.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

_NORMAL_RUNS = 60
# Runs' worth of belief in normal errors: the fewest at which intervals of normal ones hold.


class Estimate(NamedTuple):
    """A statistic and its Monte Carlo standard error, both of shape (parameters,)."""

    value: np.ndarray
    mcse: np.ndarray


class Bounded(NamedTuple):
    """A statistic and its confidence interval, all three of one shape."""

    value: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


def central_tails(confidence: float) -> tuple[float, float]:
    """Cumulative probabilities at the two ends of a central interval.

    Parameters
    ----------
    confidence : float
        Probability inside the interval.

    Returns
    -------
    tuple of float
        (1 - confidence) / 2 and (1 + confidence) / 2.

    Raises
    ------
    ValueError
        If `confidence` is not between 0 and 1.
    """
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence is {confidence}; it must lie between 0 and 1")
    return (1.0 - confidence) / 2.0, (1.0 + confidence) / 2.0


def checked_errors(error: ArrayLike) -> np.ndarray:
    """Return errors, shape (runs, parameters), as a float array known to be fit for statistics.

    Raises
    ------
    ValueError
        If the array is not two-dimensional, has no run, or holds a value that is not finite: a
        NaN would pass silently as "outside the bound".
    """
    values = np.asarray(error, dtype=float)
    if values.ndim != 2 or len(values) == 0:
        raise ValueError(f"errors have shape {values.shape}; expected (runs, parameters), runs > 0")
    if not np.isfinite(values).all():
        raise ValueError("errors hold values that are not finite")
    return values


def bias(error: ArrayLike) -> Estimate:
    """Mean error (Morris et al., "Bias").

    Parameters
    ----------
    error : array_like, shape (runs, parameters)

    Returns
    -------
    Estimate
        In the unit of the errors; the standard error is NaN for a single run.
    """
    values = checked_errors(error)
    return Estimate(values.mean(axis=0), _spread(values) / np.sqrt(len(values)))


def standard_deviation(error: ArrayLike) -> Estimate:
    """Scatter of the error about its mean, with n - 1 in the denominator (Morris et al., "EmpSE").

    Parameters
    ----------
    error : array_like, shape (runs, parameters)

    Returns
    -------
    Estimate
        In the unit of the errors; NaN for a single run. The standard error assumes normal errors.
    """
    values = checked_errors(error)
    spread = _spread(values)
    return Estimate(spread, spread / np.sqrt(2 * (len(values) - 1)))


def rmse(error: ArrayLike, confidence: float = 0.95) -> Bounded:
    """Root mean square error and its confidence interval.

    Parameters
    ----------
    error : array_like, shape (runs, parameters)
        Not all zero in any parameter.
    confidence : float

    Returns
    -------
    Bounded
        In the unit of the errors, shape (parameters,); the interval is NaN for a single run.

    Notes
    -----
    The mean square is taken as chi-square over its degrees of freedom, 2 runs / (kurtosis - 1):
    as many as there are runs if the errors are normal (Satterthwaite, 1946, Biometrics Bulletin
    2:110-114). The kurtosis, about zero, is that of the errors drawn towards the 3 of normal ones,
    as if the campaign had had so many more of those (Bonett, 2006, Computational Statistics & Data
    Analysis 50:775-782, does so for a variance). So few runs, which do not know their kurtosis, get
    the interval of normal errors, many the one of their own. 95 % cover, measured,

    ======================  ====  ====  ====  ====  ====
    errors; runs:              3    10    32   100   500
    ======================  ====  ====  ====  ====  ====
    of normal errors        94.9  95.1  94.7  94.9  95.0
    with a bias of 3 sigma   100   100   100  99.8  98.3
    uniform                 99.1  99.6  99.5  98.5  96.7
    Student, 6 degrees      91.4  88.3  88.0  90.4  93.2
    ======================  ====  ====  ====  ====  ====
    """
    values = checked_errors(error)
    value = np.sqrt(np.square(values).mean(axis=0))
    lower, upper = _relative_limits(values, confidence)
    return Bounded(value, value * lower, value * upper)


def rmse_half_width_relative(error: ArrayLike, confidence: float = 0.95) -> np.ndarray:
    """Half the width of the interval of `rmse`, as a fraction of the RMSE.

    The precision of a campaign: for many normal errors close to 1.386 / sqrt(runs) at 95 %.

    Parameters
    ----------
    error : array_like, shape (runs, parameters)
        Not all zero in any parameter.
    confidence : float

    Returns
    -------
    ndarray, shape (parameters,)
        NaN for a single run, so that no ``precision < target`` rule stops there.
    """
    lower, upper = _relative_limits(checked_errors(error), confidence)
    return (upper - lower) / 2.0


def abs_error_quantile(error: ArrayLike, level: float) -> np.ndarray:
    """Quantile of the absolute error.

    Parameters
    ----------
    error : array_like, shape (runs, parameters)
    level : float
        Probability, such as 0.95 or 0.997; `ValueError` if it is none.

    Returns
    -------
    ndarray, shape (parameters,)
        In the unit of the errors. The largest |error| if the runs are too few for the level
        (0.997 takes 222 runs).

    Notes
    -----
    The approximately median-unbiased estimate, type 8 of Hyndman & Fan (1996), The American
    Statistician 50:361-365: the usual linear one reads low in the tail.
    """
    return np.quantile(np.abs(checked_errors(error)), level, axis=0, method="median_unbiased")


def model_error_percent(error: ArrayLike, predicted_std: ArrayLike) -> Estimate:
    """Relative error of the predicted standard deviation, 100 (predicted / actual - 1).

    Parameters
    ----------
    error : array_like, shape (runs, parameters)
        Not constant in any parameter.
    predicted_std : array_like, shape (parameters,)
        Standard deviation the filter claims, the same in every run, in the unit of the errors.

    Returns
    -------
    Estimate
        In percent; NaN for a single run.

    Notes
    -----
    Morris et al., "Relative % error in ModSE". Their average model standard error is
    `predicted_std` itself: it does not vary between runs, so its own standard error is zero.
    """
    spread, spread_mcse = standard_deviation(error)
    percent = 100.0 * np.asarray(predicted_std, dtype=float) / spread
    return Estimate(percent - 100.0, percent * spread_mcse / spread)


def bias_eliminated_coverage(error: ArrayLike, half_width: ArrayLike) -> Estimate:
    """Share of runs with the error within `half_width` of the mean error (Morris et al.).

    Next to `share_within` it tells a biased estimate from a wrong predicted spread.

    Parameters
    ----------
    error : array_like, shape (runs, parameters)
    half_width : array_like, shape (parameters,)
        In the unit of the errors: k times the predicted standard deviation.

    Returns
    -------
    Estimate
        Share between 0 and 1.
    """
    values = checked_errors(error)
    share = (np.abs(values - values.mean(axis=0)) <= np.asarray(half_width)).mean(axis=0)
    return Estimate(share, np.sqrt(share * (1.0 - share) / len(values)))


def wilson_interval(successes: ArrayLike, trials: ArrayLike, confidence: float = 0.95) -> Bounded:
    """Share of successes and its Wilson score interval.

    Parameters
    ----------
    successes, trials : array_like
        Counts of any shapes that broadcast.
    confidence : float

    Returns
    -------
    Bounded
        successes / trials and the interval, of the broadcast shape.

    Raises
    ------
    ValueError
        Unless 0 <= successes <= trials and trials > 0.

    Notes
    -----
    Wilson (1927), Journal of the American Statistical Association 22:209-212, without continuity
    correction; `scipy.stats.binomtest` has it for one count at a time.
    """
    hits, n = np.asarray(successes, dtype=float), np.asarray(trials, dtype=float)
    if not ((n > 0) & (hits >= 0) & (hits <= n)).all():
        raise ValueError("successes must lie between 0 and trials, and trials be positive")
    z = normal_quantile(confidence)
    share = hits / n
    centre = (hits + z**2 / 2) / (n + z**2)
    half = z / (n + z**2) * np.sqrt(n * share * (1.0 - share) + z**2 / 4)
    # Rounding may leave the ends just outside the shares there are.
    return Bounded(share, np.maximum(centre - half, 0.0), np.minimum(centre + half, 1.0))


def share_within(error: ArrayLike, half_width: ArrayLike, confidence: float = 0.95) -> Bounded:
    """Share of runs with |error| <= `half_width`, per parameter, with its Wilson interval.

    With an accuracy bound it is the share of runs that meet the bound; with k times the predicted
    standard deviation it is the coverage of k sigma, to be held against `nominal_coverage`.

    Parameters
    ----------
    error : array_like, shape (runs, parameters)
    half_width : array_like, shape (parameters,)
        In the unit of the errors.
    confidence : float

    Returns
    -------
    Bounded
        Shares between 0 and 1, shape (parameters,).
    """
    inside = np.abs(checked_errors(error)) <= np.asarray(half_width)
    return wilson_interval(inside.sum(axis=0), len(inside), confidence)


def nominal_coverage(sigmas: float) -> float:
    """Coverage of k sigma by normal errors: 0.6827, 0.9545 and 0.9973 for 1, 2 and 3 sigma."""
    return float(1.0 - 2.0 * special.ndtr(-sigmas))


def normal_quantile(share: float) -> float:
    """Sigmas on either side that hold a share of normal errors: the inverse of `nominal_coverage`.

    1.96 for 0.95, 2.58 for 0.99.
    """
    return float(special.ndtri(central_tails(share)[1]))


def nees(error: ArrayLike, covariance: ArrayLike) -> np.ndarray:
    """Normalised estimation error squared (NEES), e^T P^-1 e, of each run (Bar-Shalom et al.).

    Of innovations and their covariances it is the normalised innovation squared (NIS).

    Parameters
    ----------
    error : array_like, shape (runs, n)
        Errors by run, or innovations by update.
    covariance : array_like, shape (n, n) or (runs, n, n)
        Covariance the filter claims, of every row or of each, in the units of the errors.

    Returns
    -------
    ndarray, shape (runs,)
        Chi-square with n degrees of freedom if the filter is consistent.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a covariance is not positive definite.
    """
    factor = np.linalg.cholesky(np.asarray(covariance, dtype=float))
    whitened = np.linalg.solve(factor, checked_errors(error)[..., None])
    return np.square(whitened).sum(axis=(1, 2))


def nees_interval(runs: int, dof: int, confidence: float = 0.95) -> tuple[float, float]:
    """Interval in which the mean NEES of a consistent filter lies (Bar-Shalom et al.).

    Parameters
    ----------
    runs : int
        Independent values averaged: runs for NEES, updates for NIS.
    dof : int
        Dimension of one error or innovation.
    confidence : float

    Returns
    -------
    tuple of float
        Lower and upper limit, with equal tails: runs times the mean is chi-square with runs * dof
        degrees of freedom.

    Raises
    ------
    ValueError
        If `runs` or `dof` is not positive.
    """
    if runs < 1 or dof < 1:
        raise ValueError(f"runs {runs} and degrees of freedom {dof} must be positive")
    # chi-square with n degrees of freedom is twice gamma of shape n / 2
    lower, upper = 2 * special.gammaincinv(runs * dof / 2, central_tails(confidence)) / runs
    return float(lower), float(upper)


def _spread(values: np.ndarray) -> np.ndarray:
    # One run has no spread: NaN, said here rather than by a numpy warning.
    if len(values) == 1:
        return np.full(values.shape[1:], np.nan)
    return values.std(axis=0, ddof=1)


def _relative_limits(values: np.ndarray, confidence: float) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the interval of `rmse` over its value; NaN for a single run."""
    runs, square = len(values), np.square(values)
    if runs == 1:
        nothing = np.full(values.shape[1], np.nan)
        return nothing, nothing
    found = np.square(square).mean(axis=0) / np.square(square.mean(axis=0))
    # the mean of `found` is 3 runs / (runs + 2) if errors are normal
    kurtosis = (3.0 * _NORMAL_RUNS + (runs + 2) * found) / (_NORMAL_RUNS + runs)
    half = runs / (kurtosis - 1.0)  # of the degrees of freedom
    low, high = (special.gammaincinv(half, tail) / half for tail in central_tails(confidence))
    return 1.0 / np.sqrt(high), 1.0 / np.sqrt(low)
