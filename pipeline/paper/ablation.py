"""What it costs to leave states out: filters of fewer states against the full one, run by run."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from inscal.summary import DONE
from pipeline.campaign import store
from pipeline.campaign.judged import comparison, summary
from pipeline.config.schema import Config

MODELS: dict[str, str] = {
    "states30": "30 states",
    "states33_quadratic": "33, with quadratic terms",
    "states33_lever_arm": "33, with lever arms",
}
"""Filters of fewer states: end of the store's name, and what they are called."""

FULL = "36 states"

TRUTHS: dict[str, str] = {
    "dispersed errors": "position25-reference",
    "the paper's errors": "position25-reference-paper_truth",
    "the paper's errors, quadratic terms in SI": "position25-reference-paper_truth-si",
}
"""True sensor errors, and the store of the full filter."""

_ONE_RUN = 0.2  # share of a mean square error from which on one run is said to decide it
_RESAMPLES = 4000
_BLOCK = 100  # resamples at a time, for memory


@dataclass(frozen=True)
class Ratio:
    """Size of errors of one filter over that of another, and simultaneous limits, each (27,)."""

    ratio: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


@dataclass(frozen=True)
class Reduced:
    """A filter of fewer states against the full one, over runs done by both.

    Attributes
    ----------
    summary : Dataset
        Of `inscal.summary.summarize`.
    comparison : Dataset
        Of `inscal.summary.compare`, the full filter being b.
    median : Ratio
        Of the medians of |error|, which no single run decides.
    heaviest : float
        Largest share that a single run has in the mean square error of a parameter.
    """

    summary: xr.Dataset
    comparison: xr.Dataset
    median: Ratio
    heaviest: float

    @property
    def modelled(self) -> np.ndarray:
        """Which parameters the filter estimates, shape (27,)."""
        return self.summary["predicted_std"].to_numpy() > 0.0

    @property
    def one_run_decides(self) -> bool:
        """Whether a single run makes up too much of a mean square error for RMSE to say much."""
        return self.heaviest > _ONE_RUN

    @property
    def cost(self) -> Ratio:
        """Ratio to judge by, of RMSE unless one run decides it, with simultaneous limits."""
        if self.one_run_decides:
            return self.median
        keys = ("ratio", "simultaneous_lower", "simultaneous_upper")
        return Ratio(*(self.comparison[key].to_numpy() for key in keys))

    @property
    def worse(self) -> np.ndarray:
        """Which of the parameters it models it estimates worse beyond doubt, shape (27,)."""
        return self.modelled & (self.cost.lower > 1.0)

    @property
    def better(self) -> np.ndarray:
        """Which of the parameters it models it estimates better beyond doubt, shape (27,)."""
        return self.modelled & (self.cost.upper < 1.0)


@dataclass(frozen=True)
class Ablation:
    """All filters on one kind of truth.

    Attributes
    ----------
    full : Dataset
        Summary of the full filter.
    reduced : mapping of str to Reduced
        By the keys of `MODELS`.
    """

    full: xr.Dataset
    reduced: Mapping[str, Reduced]


def ablation_of(config: Config, full: str | Path) -> Ablation:
    """Compare the filters on one kind of truth.

    Parameters
    ----------
    config : Config
        Gives the bounds.
    full : str or Path
        Store of the full filter; the others' end in the keys of `MODELS`.

    Returns
    -------
    Ablation

    Raises
    ------
    DataError
        If a store is missing or cannot be paired.
    """
    complete = store.read(full)
    reduced = {end: _reduced(config, f"{full}-{end}", full, complete) for end in MODELS}
    return Ablation(summary(config, full, complete), reduced)


def _reduced(config: Config, path: str, full: str | Path, other: xr.Dataset) -> Reduced:
    own = store.read(path)
    both = ((own["status"] == DONE) & (other["status"] == DONE)).to_numpy()
    error, error_full = (
        c["error"].transpose("run", "parameter").to_numpy()[both] for c in (own, other)
    )
    square = np.square(error)
    return Reduced(
        summary(config, path, own),
        comparison(path, own, full, other),
        median_ratio(error, error_full, np.random.default_rng(own.attrs["seed"])),
        float((square.max(axis=0) / square.sum(axis=0)).max()),
    )


def median_ratio(
    error_a: np.ndarray, error_b: np.ndarray, rng: np.random.Generator, confidence: float = 0.95
) -> Ratio:
    """Median |error| of a over that of b of paired runs, with simultaneous intervals.

    Parameters
    ----------
    error_a, error_b : ndarray, shape (runs, parameters)
    rng : numpy.random.Generator
    confidence : float
        That all intervals hold at once.

    Returns
    -------
    Ratio
        Percentile intervals of a bootstrap of whole runs (Efron & Tibshirani 1993, ch. 13), their
        tails divided among the parameters (Bonferroni).
    """
    size_a, size_b = np.abs(error_a), np.abs(error_b)
    runs, parameters = size_a.shape
    resampled = np.empty((_RESAMPLES, parameters))
    for first in range(0, _RESAMPLES, _BLOCK):
        drawn = rng.integers(runs, size=(_BLOCK, runs))
        medians = (np.median(size[drawn], axis=1) for size in (size_a, size_b))
        resampled[first : first + _BLOCK] = np.divide(*medians)
    tail = 0.5 * (1.0 - confidence) / parameters
    lower, upper = np.quantile(resampled, (tail, 1.0 - tail), axis=0)
    return Ratio(np.median(size_a, axis=0) / np.median(size_b, axis=0), lower, upper)


def table(ablations: Mapping[str, Ablation]) -> str:
    """CSV text of every number: a row for each truth, filter and parameter."""
    frames = []
    for truth, ablation in ablations.items():
        frames.append(_frame(truth, FULL, ablation.full))
        for end, reduced in ablation.reduced.items():
            frame = _frame(truth, MODELS[end], reduced.summary)
            for key in ("ratio", "simultaneous_lower", "simultaneous_upper", "p_ratio_above_one"):
                frame[f"rmse_{key}"] = reduced.comparison[key].to_numpy()
            frame["median_ratio"] = reduced.median.ratio
            frame["median_simultaneous_lower"] = reduced.median.lower
            frame["median_simultaneous_upper"] = reduced.median.upper
            frames.append(frame)
    return pd.concat(frames).to_csv(index=False, float_format="%.6g")


def _frame(truth: str, model: str, summary: xr.Dataset) -> pd.DataFrame:
    keys = (
        *("bias", "bias_mcse", "std", "rmse", "rmse_lower", "rmse_upper"),
        *("predicted_std", "share_within_bound"),
    )
    columns = {key: summary[key].to_numpy() for key in keys}
    labels = {
        "truth": truth,
        "filter": model,
        "parameter": summary["parameter"].to_numpy(),
        "unit": summary["unit"].to_numpy(),
        "modelled": summary["predicted_std"].to_numpy() > 0.0,
    }
    return pd.DataFrame(labels | columns)
