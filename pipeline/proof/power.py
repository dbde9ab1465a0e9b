"""How often the goals are missed: by a perfect filter, and by filters whose sigmas are too small.

Campaigns are drawn from what the goals suppose of a perfect filter: normal errors of the covariance
it claims, a sum of the NIS that is chi-square, autocorrelations beyond their band that are a
binomial count. So this measures the looks and their levels together, with the correlations between
them that Bonferroni does not use, on as many campaigns as one likes.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from inscal import chance
from inscal.parameters import COUNT
from pipeline.console.output import json_data
from pipeline.console.progress import track
from pipeline.proof.looks import (
    LEVEL,
    LOOKS,
    OUTSIDE_BAND,
    Innovations,
    at_estimates,
    at_innovations,
    missed,
)

PATH = Path("results/consistency/power.json")
"""What was measured."""

PERFECT = "perfect"
"""The filter that no goal should speak against."""


class Kind(NamedTuple):
    """Filters whose campaigns are drawn.

    Attributes
    ----------
    subject : str
        Which claimed sigmas are too small.
    too_small : float
        By which share of what they should be.
    places : slice
        Those parameters.
    campaigns : int
    """

    subject: str
    too_small: float
    places: slice
    campaigns: int


_ALL, _ONE = slice(None), slice(0, 1)

KINDS = {
    PERFECT: Kind("no sigma", 0.0, _ALL, 10_000),
    "all_5_percent": Kind("all sigmas", 0.05, _ALL, 1000),
    "all_2_percent": Kind("all sigmas", 0.02, _ALL, 1000),
    "one_20_percent": Kind("one sigma", 0.20, _ONE, 1000),
    "one_10_percent": Kind("one sigma", 0.10, _ONE, 1000),
}
"""By key of what was measured."""


class Campaign(NamedTuple):
    """What decides how often a campaign misses a goal.

    Attributes
    ----------
    correlation : ndarray, shape (27, 27)
        That the filter claims of its errors.
    runs : int
    innovations : Innovations
        Of which only the expectations are used.
    """

    correlation: np.ndarray
    runs: int
    innovations: Innovations

    def about(self) -> dict[str, Any]:
        """What a measurement must agree in, as JSON takes it, to hold of a campaign."""
        return {
            "runs": self.runs,
            "correlations": self.innovations.correlations,
            "level": LEVEL,
            "looks": dict(LOOKS),
        }

    def missed(self, too_small: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
        """Tell which of some campaigns drawn miss a goal.

        Parameters
        ----------
        too_small : ndarray, shape (27,)
            Share that each claimed sigma lacks.
        count : int
            Of campaigns.
        rng : numpy.random.Generator

        Returns
        -------
        ndarray of bool, shape (count,)
        """
        claimed, root = 1.0 - too_small, np.linalg.cholesky(self.correlation)
        inverse = np.linalg.inv(self.correlation)
        out = np.empty(count, dtype=bool)
        for number in range(count):
            error = rng.standard_normal((self.runs, COUNT)) @ root.T / claimed
            nees = (error @ inverse * error).sum(axis=1)
            p = at_estimates(error, nees, 1.0 / claimed, self.correlation)
            p |= at_innovations(self._drawn(rng))
            out[number] = any(missed(goal, values) for goal, values in p.items())
        return out

    def _drawn(self, rng: np.random.Generator) -> Innovations:
        _, dof, _, correlations = self.innovations
        beyond = int(rng.binomial(correlations, OUTSIDE_BAND))
        return Innovations(float(rng.chisquare(dof)), dof, beyond, correlations)


def measure(campaign: Campaign, seed: int) -> dict[str, Any]:
    """Measure how often goals are missed.

    Parameters
    ----------
    campaign : Campaign
    seed : int

    Returns
    -------
    dict
        As JSON takes it: what the campaign is, and of every kind the share that misses a goal with
        its exact 95 % interval.
    """
    rng = np.random.default_rng(seed)
    out = campaign.about() | {"seed": seed}
    for name, kind in track(list(KINDS.items()), "kinds of filters"):
        too_small = np.zeros(COUNT)
        too_small[kind.places] = kind.too_small
        hits = campaign.missed(too_small, kind.campaigns, rng).sum()
        share = chance.clopper_pearson(hits, kind.campaigns)
        out[name] = {key: float(value) for key, value in share._asdict().items()}
        out[name]["campaigns"] = kind.campaigns
    return out


def measured(campaign: Campaign, path: Path = PATH) -> dict[str, Any]:
    """Read what was measured; nothing if that was nothing, or not of such a campaign."""
    try:
        found = json_data(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    about = campaign.about()
    return found if {key: found.get(key) for key in about} == about else {}
