"""Looks at a filter for a contradiction, and the level of each.

A goal that chance can miss is a look, or one at every parameter, and each look has a p-value. The
goals share `LEVEL` equally, and so do the looks of a goal (Bonferroni): a perfect filter misses any
of them in `LEVEL` of campaigns at most.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from inscal import chance
from inscal.parameters import COUNT, NAMES
from inscal.statistics import nominal_coverage

LEVEL = 0.01
"""Largest share of campaigns of a perfect filter that miss any goal."""

LOOKS: Mapping[str, int] = {
    **{"nees": 1, "nees_distribution": 1},
    **{"bias": COUNT, "bias_together": 1, "sigma": COUNT},
    **{f"coverage_{count}_sigma": COUNT for count in (1, 2, 3)},
    **{"rmse_over_bound": COUNT, "nis": 1, "white": 1},
}
"""Goals that chance can miss, and how many looks each takes."""

OUTSIDE_BAND = 0.05
"""Share of a white sequence's autocorrelations outside their band."""

P = Mapping[str, np.ndarray]


def level(goal: str) -> float:
    """Level of each look of a goal."""
    return LEVEL / len(LOOKS) / LOOKS[goal]


def missed(goal: str, p: np.ndarray | float) -> bool:
    """Whether any of a goal's p-values speaks against it."""
    return bool(np.min(p) < level(goal))


def together(deviation: np.ndarray, correlation: np.ndarray) -> np.ndarray:
    """Squared length of deviations (..., 27), in sigmas, that are correlated like this."""
    return np.asarray((deviation @ np.linalg.inv(correlation) * deviation).sum(axis=-1))


def at_estimates(
    error: np.ndarray, nees: np.ndarray, bound: np.ndarray, correlation: np.ndarray
) -> dict[str, np.ndarray]:
    """p-values of the looks at estimates.

    Parameters
    ----------
    error : ndarray, shape (runs, 27)
        In units of the sigma that the filter claims.
    nees : ndarray, shape (runs,)
    bound : ndarray, shape (27,)
        Cramér-Rao bound in the same units.
    correlation : ndarray, shape (27, 27)
        That the filter claims of its errors.

    Returns
    -------
    dict of str to ndarray
    """
    runs, size = len(error), np.abs(error)
    mean, square = error.mean(axis=0), np.square(error).mean(axis=0)
    variance = (square - mean**2) * runs / (runs - 1)
    coverage = {
        f"coverage_{count}_sigma": chance.binomial_p(
            (size <= count).sum(axis=0), runs, nominal_coverage(count)
        )
        for count in (1, 2, 3)
    }
    return {
        "nees": chance.chi_square_p(nees.sum(), runs * COUNT),
        "nees_distribution": np.asarray(chance.distribution_p(nees, COUNT)),
        "bias": chance.student_p(mean / np.sqrt(variance / runs), runs - 1),
        "bias_together": chance.too_long_p(runs * together(mean, correlation), COUNT),
        "sigma": chance.chi_square_p((runs - 1) * variance, runs - 1),
        **coverage,
        "rmse_over_bound": chance.chi_square_p(runs * square / bound**2, runs),
    }


class Innovations(NamedTuple):
    """Of the last pass, over the whole record of the runs repeated.

    Attributes
    ----------
    nis_total, nis_dof : float
        Sum of the NIS, and what it should be: its degrees of freedom.
    beyond, correlations : int
        Autocorrelations beyond the band of white noise, and how many there are.
    """

    nis_total: float
    nis_dof: float
    beyond: int
    correlations: int


def at_innovations(found: Innovations) -> dict[str, np.ndarray]:
    """p-values of the looks at innovations."""
    return {
        "nis": chance.chi_square_p(found.nis_total, found.nis_dof),
        "white": chance.binomial_p(found.beyond, found.correlations, OUTSIDE_BAND),
    }


def smallest(p: P) -> dict[str, dict[str, Any]]:
    """By goal: the smallest p-value, its level, the number of looks and, of several, where.

    Parameters
    ----------
    p : mapping of str to ndarray
        From `at_estimates` and `at_innovations`.

    Returns
    -------
    dict
        As JSON takes it.
    """
    return {
        goal: {
            "p": float(np.min(values)),
            "level": level(goal),
            "looks": LOOKS[goal],
            "where": NAMES[int(np.argmin(values))] if values.size > 1 else "",
        }
        for goal, values in p.items()
    }
