"""Densities that curves are drawn of; `scipy.stats` has them too, and takes 0.3 s to import."""

import numpy as np
from scipy import special


def normal(x: np.ndarray, sigma: float) -> np.ndarray:
    """Density of normal errors of zero mean, per unit of `x`."""
    return np.exp(-((x / sigma) ** 2) / 2.0) / np.sqrt(2.0 * np.pi) / sigma


def chi_square(x: np.ndarray, dof: int) -> np.ndarray:
    """Density of chi-square with `dof` degrees of freedom at `x` >= 0."""
    half = dof / 2.0
    power = special.xlogy(half - 1.0, x) - x / 2.0
    return np.exp(power - special.gammaln(half) - np.log(2.0) * dof / 2.0)
