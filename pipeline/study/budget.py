"""The error budget of a configuration in paper units: its table, its file, and tolerances."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from inscal import budget as library
from inscal.budget import Budget
from inscal.parameters import NAMES, UNITS
from inscal.statistics import normal_quantile
from pipeline.config.disturbance import KEYS, size_of
from pipeline.config.setup import Setup
from pipeline.study.findings import ENOUGH

MOST = 1.1
"""True over formal sigma up to which a filter's word is taken as good."""

_WHOLE = {"gyro_noise_factor", "accel_noise_factor", "velocity_noise_factor"} | {
    "position_noise_factor",
    "observation_correlation",
}
"""Sources without a size that scales."""


@dataclass(frozen=True)
class Sheet:
    """Error budget of a configuration.

    Attributes
    ----------
    budget : Budget
        SI.
    unit : ndarray, shape (27,)
        Paper units in SI.
    bound : ndarray, shape (27,)
        In paper units.
    size : mapping of str to tuple of str and float
        Of each disturbance present: its key of the configuration, and its value there.
    """

    budget: Budget
    unit: np.ndarray
    bound: np.ndarray
    size: Mapping[str, tuple[str, float]]

    @cached_property
    def variance(self) -> dict[str, np.ndarray]:
        """By source, in paper units squared, shape (27,)."""
        every = {**self.budget.formal, **self.budget.disturbances}
        return {name: np.diag(matrix) / self.unit**2 for name, matrix in every.items()}

    @property
    def formal_std(self) -> np.ndarray:
        """Sigma that the filter claims, in paper units."""
        return np.sqrt(np.diag(self.budget.formal_covariance)) / self.unit

    @property
    def true_std(self) -> np.ndarray:
        """Sigma that its errors have, in paper units."""
        return np.sqrt(np.diag(self.budget.true_covariance)) / self.unit

    @cached_property
    def share(self) -> np.ndarray:
        """Of each source in the true variance, shape (sources, 27); 0 of what is not modelled."""
        variance, total = np.array(list(self.variance.values())), self.true_std**2
        return np.divide(variance, total, out=np.zeros_like(variance), where=total > 0.0)

    def largest(self, place: int, count: int) -> list[tuple[str, float]]:
        """Sources of the largest shares in the variance of one parameter, with these."""
        sources, share = list(self.variance), self.share[:, place]
        return [(sources[s], float(share[s])) for s in np.argsort(-share, kind="stable")[:count]]

    def alone(self, *sources: str) -> "Sheet":
        """Budget with no other disturbances than some of those here: their effects add up."""
        every = self.budget.disturbances
        left = {source: every[source] for source in sources if source in every}
        return replace(self, budget=replace(self.budget, disturbances=left))

    def content(self) -> dict[str, object]:
        """What is written as JSON."""
        return {
            "parameter": list(NAMES),
            "unit": list(UNITS),
            "formal_std": self.formal_std.tolist(),
            "true_std": self.true_std.tolist(),
            "source": list(self.variance),
            "variance": [values.tolist() for values in self.variance.values()],
            "expected_nees": self.budget.expected_nees,
        }

    def tolerance(self, source: str) -> dict[str, tuple[float, str]]:
        """Largest value of a disturbance alone, and the parameter that sets it.

        Parameters
        ----------
        source : str

        Returns
        -------
        dict
            Of ``bounds``, at which every bound that the formal sigma keeps holds in `ENOUGH` of
            runs, and ``sigma``, at which no true sigma is more than `MOST` of the formal one; each
            value in the unit of the key, infinite where nothing is moved.
        """
        _, value = self.size[source]
        allowed = (self.bound / normal_quantile(ENOUGH)) ** 2 - self.formal_std**2
        # a bound that the formal sigma misses already says nothing of the laboratory
        kept = self._room(source, np.where(allowed > 0.0, allowed, np.inf))
        limits = {"bounds": kept, "sigma": self.room(source, MOST)}
        return {name: (value * np.sqrt(room), by) for name, (room, by) in limits.items()}

    def room(self, source: str, growth: float) -> tuple[float, str]:
        """How many times the variance of a source fits before a true sigma has grown by a factor.

        Parameters
        ----------
        source : str
            Alone.
        growth : float
            True over formal sigma, above one.

        Returns
        -------
        room : float
            Infinite where nothing is moved.
        parameter : str
            That sets it.
        """
        formal = self.formal_std**2
        return self._room(source, np.where(formal > 0.0, (growth**2 - 1.0) * formal, np.inf))

    def _room(self, source: str, limit: np.ndarray) -> tuple[float, str]:
        added = self.variance[source]
        times = np.divide(limit, added, out=np.full_like(added, np.inf), where=added > 0.0)
        place = int(np.argmin(times))
        return float(times[place]), NAMES[place]


def sheet(setup: Setup) -> Sheet:
    """Make the budget of a configuration.

    Parameters
    ----------
    setup : Setup

    Returns
    -------
    Sheet
    """
    experiment = setup.experiment
    made = library.budget(
        setup.transitions,
        setup.gains,
        setup.model,
        setup.noise,
        setup.prior,
        experiment.disturbed,
        experiment.truth.disturbance,
    )
    about, sizes = setup.config.disturbance, {}
    for key in KEYS:
        source = size_of(key)[0]
        if source in made.disturbances and source not in _WHOLE:
            sizes[source] = key, float(getattr(about, key))
    return Sheet(made, setup.unit, setup.bound, sizes)
