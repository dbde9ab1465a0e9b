"""The error budget of a configuration in paper units: its table, its file, and tolerances."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from inscal import budget as library
from inscal.budget import Budget, System
from inscal.parameters import NAMES, UNITS
from inscal.statistics import normal_quantile
from inscal.traces import traces
from pipeline.config.disturbance import KEYS, size_of
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.study.findings import ENOUGH

MOST = 1.1
"""True over formal sigma up to which a filter's word is taken as good."""

BOUNDS = "bounds"
"""What a disturbance may grow to where it is not a true sigma that must not grow by more."""

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
    system : System
        That the budget is of.
    """

    budget: Budget
    unit: np.ndarray
    bound: np.ndarray
    size: Mapping[str, tuple[str, float]]
    system: System

    @cached_property
    def variance(self) -> dict[str, np.ndarray]:
        """By source, in paper units squared, shape (27,)."""
        return _variance(self.budget, self.unit)

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

    @property
    def most_disturbed(self) -> int:
        """Parameter whose true sigma is largest beside the formal one."""
        ratio = np.zeros_like(self.true_std)
        np.divide(self.true_std, self.formal_std, out=ratio, where=self.formal_std > 0.0)
        return int(np.argmax(ratio))

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
        limits = {"bounds": self.room(source, BOUNDS), "sigma": self.room(source, MOST)}
        return {name: (value * np.sqrt(room), by) for name, (room, by) in limits.items()}

    def room(self, source: str, growth: float | str) -> tuple[float, str]:
        """How many times the variance of a source fits before a true sigma has grown too much.

        Parameters
        ----------
        source : str
            Alone.
        growth : float or str
            True over formal sigma, above one; or `BOUNDS`: until the first bound is no longer kept
            in `ENOUGH` of runs.

        Returns
        -------
        room : float
            Infinite where nothing is moved.
        parameter : str
            That sets it.
        """
        formal, added = self.formal_std**2, self.variance[source]
        if growth == BOUNDS:
            # a bound that the formal sigma misses already says nothing of the laboratory
            limit = (self.bound / normal_quantile(ENOUGH)) ** 2 - formal
        else:
            limit = (float(growth) ** 2 - 1.0) * formal
        limit = np.where(limit > 0.0, limit, np.inf)
        times = np.divide(limit, added, out=np.full_like(added, np.inf), where=added > 0.0)
        place = int(np.argmin(times))
        return float(times[place]), NAMES[place]

    @cached_property
    def hiding(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Of each constant at its size, by source: what it does, and the trace that it leaves.

        Shape (n,) each, in sigmas: how far it moves the estimates, and at how many standard
        deviations the best test of the innovations finds it (`inscal.traces`).
        """
        covariance = self.budget.formal_covariance
        own = np.flatnonzero(np.diag(covariance) > 0.0)
        sigma = np.sqrt(np.diag(covariance))[own]
        scaled = covariance[np.ix_(own, own)] / np.outer(sigma, sigma)
        out = {}
        for source, seen in traces(self.system).items():
            size = getattr(self.system.factors, source)
            moved = size * self.budget.effects[source][own] / sigma[:, None]
            squared = np.einsum("in,in->n", moved, np.linalg.solve(scaled, moved))
            out[source] = np.sqrt(squared), size * np.sqrt(np.maximum(np.diag(seen), 0.0))
        return out

    def course(self, place: int, updates: Sequence[int]) -> dict[str, np.ndarray]:
        """Variance of one parameter by source after so many updates, in paper units squared.

        Of the first pass over the record, shape (len(updates),).
        """
        unit = self.unit[[place]]
        each = [
            _variance(library.budget(self.system, parameters=[place], updates=k), unit)
            for k in updates
        ]
        return {source: np.concatenate([one[source] for one in each]) for source in each[0]}


def checkpoints(config: Config) -> list[int]:
    """Numbers of updates at which a budget is drawn over time: twice in every position."""
    ends = Setup(config).schedule.ends / config.estimator.update_interval_s
    middles = 0.5 * (ends + np.concatenate([[0.0], ends[:-1]]))
    return [int(k) for k in np.rint(np.stack([middles, ends], axis=1)).ravel()]


def _variance(budget: Budget, unit: np.ndarray) -> dict[str, np.ndarray]:
    every = {**budget.formal, **budget.disturbances}
    return {name: np.diag(matrix) / unit**2 for name, matrix in every.items()}


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
    system = library.System(
        setup.transitions,
        setup.gains,
        setup.model,
        setup.believed_noise,
        setup.prior,
        experiment.disturbed,
        experiment.truth.disturbance,
        setup.believed,
    )
    made = library.budget(system)
    about, sizes = setup.config.disturbance, {}
    for key in KEYS:
        source = size_of(key)[0]
        if source in made.disturbances and source not in _WHOLE | system.modelled:
            sizes[source] = key, float(getattr(about, key))
    return Sheet(made, setup.unit, setup.bound, sizes, system)
