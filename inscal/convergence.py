"""Whether a run's passes have converged, and whether its own data speak for the result.

**Convergence.** A further pass linearises about the result of the last, so it changes that result
by what the last one neglected: products of its step with the parameters themselves. Of steps in the
matrices of scale factors and installation angles this is known: the pass finds D where
I + K + D (I + K) was wanted, so that D K is left. Of all other constants only the size is, that of
the largest entry of K times the step. The larger of the two is the change to expect. At the
reference case two passes leave 0.005 sigma to be changed, 0.09 at most in 4 096 runs.

**Verdict.** If model and noise are what the filter believes, the normalised innovations squared
(NIS) of a converged pass add up to chi-square, with the number of observations as its degrees of
freedom, or fewer by up to the number of constants that the record has already told. What the
pass's own step adds is taken off: where x_T - x0 is what the tight pass found and x - x0 the
translated step, that is (x_T - x0)^T T_0^-1 (x - x0). A run of 75 000 observations shows noise that
is two per cent beside what the filter believes, so innovations beyond chance contradict the filter
and are told; a run has failed only where they are beyond any noise that it could be mistaken for.
"""

import numpy as np
from scipy import special
from scipy.linalg import solve_triangular

from inscal.estimator import CONSTANTS, Estimator
from inscal.parameters import COUNT, INDEX
from inscal.sensor import matrices
from inscal.state_model import OBSERVED

REASONS = (
    "",
    "estimates are not finite",
    "passes have not converged",
    "innovations are beyond the limit",
    "its computation raised an exception",
)
"""Why a run failed, by number; the first is that of a run that did not."""
NOT_FINITE, NOT_CONVERGED, BEYOND_LIMIT, RAISED = 1, 2, 3, 4

_ENOUGH = 0.2
"""Sigmas of expected change that ask for no pass beyond those that every run gets. In all cases
tried a further pass then changed no constant by more than 0.25 sigma, and 0.06 in root mean square:
half a percent of the mean square error at the very most."""

_FALSE_ALARM = 1e-6
"""Probability that a run of a right model is said to be beyond chance."""


def expected_change(estimator: Estimator, step: np.ndarray, result: np.ndarray) -> np.ndarray:
    """Largest change of a constant that a further pass can be expected to make, in sigmas.

    Parameters
    ----------
    estimator : Estimator
    step : ndarray, shape (30, lanes)
        What the last pass changed, SI.
    result : ndarray, shape (30, lanes)
        Its result, SI.

    Returns
    -------
    ndarray, shape (lanes,)
        Not finite where the step is not.
    """
    error = matrices(result)
    left = _entries(matrices(step) @ error)
    size = np.abs(error).max(axis=(0, 2, 3))
    return np.asarray(np.maximum(size * _in_sigmas(estimator, step), _in_sigmas(estimator, left)))


def have_converged(
    estimator: Estimator, passes: int, step: np.ndarray, result: np.ndarray
) -> np.ndarray:
    """Tell which lanes need no further pass.

    Parameters
    ----------
    estimator : Estimator
    passes : int
        Made so far, at least those that every run gets.
    step, result : ndarray, shape (30, lanes)
        What the last of them changed, and its result, SI.

    Returns
    -------
    ndarray of bool, shape (lanes,)
    """
    with np.errstate(invalid="ignore", over="ignore"):  # of lanes that ran away
        converged = _in_sigmas(estimator, step) < estimator.convergence_sigma
        if passes <= estimator.passes:
            converged |= expected_change(estimator, step, result) < _ENOUGH
    return converged


def innovation_ratio(
    estimator: Estimator, nis: np.ndarray, tight_step: np.ndarray, step: np.ndarray
) -> np.ndarray:
    """Mean NIS of an observation in a converged pass, 1 where the filter is right.

    Parameters
    ----------
    estimator : Estimator
    nis : ndarray, shape (lanes,)
        Normalised innovations squared, summed over the pass.
    tight_step, step : ndarray, shape (30, lanes)
        Change of the constants before and after translation, SI.

    Returns
    -------
    ndarray, shape (lanes,)
    """
    weight = estimator.per_tight[:, None] ** 2
    with np.errstate(invalid="ignore", over="ignore"):
        own = nis - (weight * tight_step * step).sum(axis=0)
    return np.asarray(own / (OBSERVED * len(estimator.first.gain)))


def chance_limits(updates: int) -> tuple[float, float]:
    """Between what innovation ratios chance leaves a run of a right model, but for one in 1e6.

    Parameters
    ----------
    updates : int
        Of a pass.

    Returns
    -------
    lower, upper : float
    """
    count = OBSERVED * updates
    low = special.chdtri(max(count - CONSTANTS, 1), 1.0 - 0.5 * _FALSE_ALARM)
    high = special.chdtri(count, 0.5 * _FALSE_ALARM)
    return float(low / count), float(high / count)


def expected_excess(estimator: Estimator, parameter_std: np.ndarray) -> float:
    """Mean NEES to be expected beyond the number of parameters, for true errors of a size.

    The filter's covariance P is that of error-free sensors. One with the matrix I + K turns an
    error D of its estimate into D (I + K). Entries of zero mean then add to the mean NEES at least

        sum over a, b of  var(K_ab) trace(E_ab P E_ab^T P^-1),

    E_ab being the map from D to D e_ab, and e_ab zero but for a one in row a and column b.

    Parameters
    ----------
    estimator : Estimator
    parameter_std : ndarray, shape (27,)
        Root mean square of the true parameters, SI.

    Returns
    -------
    float
        3e-4 at the reference case; large where noise is so small beside the errors that some
        parameters are known better than products of the others.
    """
    modelled = np.flatnonzero(estimator.predicted_std)
    unit = estimator.predicted_std[modelled]
    block = estimator.parameter_covariance[np.ix_(modelled, modelled)] / np.outer(unit, unit)
    root = np.linalg.cholesky(block)
    units = np.eye(COUNT)[:, modelled] * unit
    total = 0.0
    for entry in range(COUNT):
        one = np.zeros((COUNT, 1))
        one[entry] = 1.0
        product = matrices(units) @ matrices(one)
        mapped = _entries(product)[modelled] / unit[:, None]
        whitened = solve_triangular(root, mapped @ root, lower=True)
        total += parameter_std[entry] ** 2 * float(np.square(whitened).sum())
    return total


def _entries(both: np.ndarray) -> np.ndarray:
    """Parameters of such matrices as `inscal.sensor.matrices` gives, the others zero."""
    out = np.zeros((COUNT, both.shape[1]))
    columns, rows = np.triu_indices(3)
    out[INDEX["gyro_k"]] = both[0][:, rows, columns].T
    out[INDEX["accel_k"]] = both[1].mT.reshape(-1, 9).T
    return out


def _in_sigmas(estimator: Estimator, change: np.ndarray) -> np.ndarray:
    """Largest of some changes of constants in units of the final sigmas, shape (lanes,)."""
    per_sigma = estimator.per_sigma[: len(change), None]
    return np.asarray(np.abs(change * per_sigma).max(axis=0))
