r"""Share of normal errors within a box: all bounds kept at once, from the full covariance.

Genz's separation of variables (Numerical computation of multivariate normal probabilities, J. Comp.
Graph. Stat. 1, 1992): with L the Cholesky factor of the covariance the probability is an integral
over the unit cube of a product of one-dimensional ones,

.. math:: d_i, e_i = \Phi\left((\mp b_i - \sum_{j<i} L_{ij} y_j) / L_{ii}\right), \quad
    y_i = \Phi^{-1}(d_i + w_i (e_i - d_i)), \quad P = E\left[\prod_i (e_i - d_i)\right],

here the mean over a fixed lattice of Richtmyer's, so that it is a smooth function of the
covariance. Variables with the least share come first, which makes the product vary least.
"""

from math import erf, sqrt

import numpy as np

from inscal.kernel import compiled, inlined

_PRIMES = np.array(
    [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71, 73, 79, 83, 89,
     97, 101, 103, 107, 109, 113, 127, 131, 137, 139, 149, 151, 157, 163, 167, 173, 179, 181, 191,
     193, 197, 199, 211, 223, 227, 229, 233, 239, 241, 251, 257, 263, 269, 271, 277, 281, 283, 293]
)  # fmt: skip
GENERATORS = np.sqrt(_PRIMES.astype(float)) % 1.0
"""Of the lattice, one for each variable."""
_FAR = 8.0  # sigmas: what is beyond is nothing


def share_within(covariance: np.ndarray, bound: np.ndarray, points: int = 4096) -> float:
    """Probability that all of some normal variables of mean zero lie within their bounds.

    Parameters
    ----------
    covariance : ndarray, shape (n, n)
        n at most 62.
    bound : ndarray, shape (n,)
    points : int
        Of the lattice; 4096 leave 1e-5 of 27 parameters.

    Returns
    -------
    float
    """
    return float(box_share(np.ascontiguousarray(covariance), bound, points, GENERATORS))


@compiled
def box_share(covariance, bound, points, generators):
    """Probability of the box; as `share_within`."""
    n = len(bound)
    order = np.argsort(bound / np.sqrt(np.diag(covariance)))
    low = np.zeros((n, n))
    limit = np.empty(n)
    for i in range(n):
        limit[i] = bound[order[i]]
        for j in range(i + 1):
            total = covariance[order[i], order[j]]
            for k in range(j):
                total -= low[i, k] * low[j, k]
            if i == j:
                low[i, i] = np.sqrt(total) if total > 0.0 else 0.0
            else:
                low[i, j] = total / low[j, j] if low[j, j] > 0.0 else 0.0
    y = np.zeros(n)
    whole = 0.0
    for point in range(points):
        product = 1.0
        for i in range(n):
            mean = 0.0
            for j in range(i):
                mean += low[i, j] * y[j]
            sigma = low[i, i]
            if sigma == 0.0:
                inside = abs(mean) <= limit[i]
                product *= 1.0 if inside else 0.0
                continue
            d, e = _below((-limit[i] - mean) / sigma), _below((limit[i] - mean) / sigma)
            product *= e - d
            if product <= 0.0:
                break
            w = ((point + 1) * generators[i]) % 1.0
            y[i] = _quantile(d + abs(2.0 * w - 1.0) * (e - d))
        whole += product
    return whole / points


@inlined
def _below(x):
    """Share of a unit normal below x."""
    if x > _FAR:
        return 1.0
    if x < -_FAR:
        return 0.0
    return 0.5 * (1.0 + erf(x / sqrt(2.0)))


@inlined
def _quantile(p):
    """Unit normal's quantile by Acklam's rational approximation, to 1.2e-9 of itself."""
    if p <= 0.0:
        return -_FAR
    if p >= 1.0:
        return _FAR
    if p < 0.02425 or p > 0.97575:
        q = np.sqrt(-2.0 * np.log(min(p, 1.0 - p)))
        x = (
            (((((-7.784894002430293e-03 * q - 3.223964580411365e-01) * q - 2.400758277161838) * q
               - 2.549732539343734) * q + 4.374664141464968) * q + 2.938163982698783)
            / ((((7.784695709041462e-03 * q + 3.224671290700398e-01) * q + 2.445134137142996) * q
                + 3.754408661907416) * q + 1.0)
        )  # fmt: skip
        return x if p < 0.5 else -x
    q = p - 0.5
    r = q * q
    return (
        (((((-3.969683028665376e01 * r + 2.209460984245205e02) * r - 2.759285104469687e02) * r
           + 1.383577518672690e02) * r - 3.066479806614716e01) * r + 2.506628277459239) * q
        / (((((-5.447609879822406e01 * r + 1.615858368580409e02) * r - 1.556989798598866e02) * r
             + 6.680131188771972e01) * r - 1.328068155288572e01) * r + 1.0)
    )  # fmt: skip
