"""Summaries and comparisons read back from their JSON files, and the verdicts they lead to.

A summary or comparison is a plain dict, as `pipeline.campaign.judged.as_json` wrote it. Nothing
here knows a result: every verdict is a threshold applied to the numbers handed in.
"""

import math
import statistics
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.campaign import store
from pipeline.console.errors import DataError
from pipeline.console.output import json_data
from pipeline.study.names import CAMPAIGNS, COMPARISONS, MAIN, PAPER_TRUTH, RUNS
from pipeline.study.verdict import MET, NOT_MET, Verdict, judged
from pipeline.words import markdown as md
from pipeline.words.render import sentence

TEMPLATES = Path(__file__).parent / "templates"
"""Folder of the texts on the study."""

RATIO_BAND = (0.93, 1.10)
"""RMSE over predicted standard deviation of a parameter whose sigma is honest."""

ENOUGH = 0.99
"""Share of runs from which on a bound counts as met."""

HONEST = "honest"
"""Word for a filter whose sigma is the scatter of its errors."""

_SUMMARY_FOLDER = Path("results/summary")
_COMPARISON_FOLDER = Path("results/comparison")
_RATIO_CEILING = 1.25
_RATIO_EXCEPTIONS = 2  # parameters that may leave the band
_NEES_BAND = (26.0, 28.5)
_SAME_TIME_PERCENT = 0.1  # a smaller difference is rounding of the position time

Summary = Mapping[str, Any]


@dataclass(frozen=True)
class Contest:
    """One campaign against another over all parameters.

    Attributes
    ----------
    a, b : str
        Names of the campaigns.
    median, lowest, highest : float
        RMSE ratios, of a over b.
    worse, better : tuple of str
        Parameters that `a` estimates worse, or better, by the simultaneous intervals.
    time_saved_percent : float
        How much less time `a` takes, in percent of that of `b`.
    """

    a: str
    b: str
    median: float
    lowest: float
    highest: float
    worse: tuple[str, ...]
    better: tuple[str, ...]
    time_saved_percent: float


def read_json(path: str | Path, stage: str) -> dict[str, Any]:
    """Read a result file; what it has as null is NaN.

    Parameters
    ----------
    path : str or Path
    stage : str
        Stage that makes it, for the message.

    Returns
    -------
    dict

    Raises
    ------
    DataError
        If it is missing or no JSON.
    """
    try:
        return json_data(Path(path).read_text())
    except FileNotFoundError:
        raise DataError(f"{path}: not found; make it with pipeline.{stage}") from None
    except (OSError, ValueError):
        raise DataError(f"{path}: cannot be read; make it anew with pipeline.{stage}") from None


def read_summary(name: str) -> dict[str, Any]:
    """Read the summary of a campaign; DataError if there is none."""
    return read_json(_SUMMARY_FOLDER / f"{name}.json", "summarize")


def read_comparison(name: str) -> dict[str, Any]:
    """Read a comparison; DataError if there is none."""
    return read_json(_COMPARISON_FOLDER / f"{name}.json", "compare")


@dataclass(frozen=True)
class Results:
    """All a report is made of.

    Attributes
    ----------
    summaries : mapping of str to summary
        By name of campaign, `CAMPAIGNS` at least.
    comparisons : mapping of str to comparison
        By the keys of `COMPARISONS`.
    configuration : mapping
        Configuration of campaign `MAIN`.
    """

    summaries: Mapping[str, Summary]
    comparisons: Mapping[str, Summary]
    configuration: Mapping[str, Any]


def collect() -> Results:
    """Read what the report is made of.

    Returns
    -------
    Results

    Raises
    ------
    DataError
        If a summary, a comparison or the store of `MAIN` is missing.
    """
    return Results(
        {name: read_summary(name) for name in CAMPAIGNS},
        {name: read_comparison(name) for name in COMPARISONS},
        store.read(RUNS / MAIN).attrs["configuration"],
    )


def ratios(summary: Summary) -> dict[str, float]:
    """RMSE over predicted standard deviation of the parameters the filter models."""
    table = {name: row["rmse_over_predicted"] for name, row in summary["parameters"].items()}
    return {name: ratio for name, ratio in table.items() if math.isfinite(ratio)}


def ratio_interval(row: Mapping[str, float]) -> tuple[float, float]:
    """95 % interval of a parameter's RMSE over predicted standard deviation."""
    return row["rmse_lower"] / row["predicted_std"], row["rmse_upper"] / row["predicted_std"]


def most_deviant(summary: Summary) -> str:
    """Name the parameter whose RMSE is farthest from the predicted one, by factor."""
    table = ratios(summary)
    return max(table, key=lambda name: abs(math.log(table[name])))


def least_within(summary: Summary) -> str:
    """Name the parameter that keeps its bound in the fewest runs."""
    table = summary["parameters"]
    return min(table, key=lambda name: table[name]["share_within_bound"])


def honesty(summary: Summary) -> str:
    """Verdict on the filter's covariance: the mean NEES against its 95 % interval."""
    if summary["nees_lower"] <= summary["nees_mean"] <= summary["nees_upper"]:
        return HONEST
    too_large = summary["nees_mean"] > summary["nees_upper"]
    return f"dishonest ({'overconfident' if too_large else 'too cautious'})"


def dishonest_parameters(summary: Summary) -> list[str]:
    """Parameters whose RMSE-over-predicted interval lies outside the band, largest ratio first."""
    table, low, high = summary["parameters"], *RATIO_BAND
    ratio = ratios(summary)
    outside = [
        name
        for name in ratio
        if ratio_interval(table[name])[0] > high or ratio_interval(table[name])[1] < low
    ]
    return sorted(outside, key=ratio.__getitem__, reverse=True)


def joint_text(summary: Summary) -> str:
    """Share of runs that keep all bounds at once, with its 95 % interval."""
    return md.share(*(summary[f"joint_share{end}"] for end in ("", "_lower", "_upper")))


def bounds_word(summary: Summary) -> str:
    """Verdict on all bounds at once."""
    return MET if summary["joint_share"] >= ENOUGH else NOT_MET


def missed(summary: Summary) -> dict[str, float]:
    """Share of runs outside the bound, of the parameters that do not meet theirs often enough."""
    table = summary["parameters"]
    return {
        name: 1.0 - row["share_within_bound"]
        for name, row in table.items()
        if row["share_within_bound"] < ENOUGH
    }


def degrees_of_freedom(summary: Summary) -> int:
    """Mean NEES of a consistent filter: the number of parameters it models."""
    return len(ratios(summary))


def checks(summaries: Mapping[str, Summary]) -> list[Verdict]:
    """Judge the project's requirements on campaigns `MAIN` and `PAPER_TRUTH`.

    Parameters
    ----------
    summaries : mapping of str to summary

    Returns
    -------
    list of Verdict
    """
    main, paper = summaries[MAIN], summaries[PAPER_TRUTH]
    (low, high), (nees_low, nees_high) = RATIO_BAND, _NEES_BAND
    ratio, count = ratios(main), len(main["parameters"])
    inside, largest = sum(low <= r <= high for r in ratio.values()), max(ratio.values())
    needed = count - _RATIO_EXCEPTIONS
    return [
        judged(
            f"`{MAIN}`: RMSE/predicted between {low:.2f} and {high:.2f} for at least {needed} of "
            f"{count} parameters and never above {_RATIO_CEILING:.2f}",
            f"{inside} of {count} inside, smallest {min(ratio.values()):.3f}, "
            f"largest {largest:.3f}",
            inside >= needed and largest <= _RATIO_CEILING,
        ),
        judged(
            f"`{MAIN}`: NEES mean between {nees_low:g} and {nees_high:g}",
            f"{main['nees_mean']:.2f}",
            nees_low <= main["nees_mean"] <= nees_high,
        ),
        judged(
            f"`{PAPER_TRUTH}`: all {count} parameters within bounds at once in at least "
            f"{100 * ENOUGH:g} % of runs",
            f"{100 * paper['joint_share']:.1f} %, 95 % interval "
            f"{100 * paper['joint_share_lower']:.1f} to {100 * paper['joint_share_upper']:.1f} %",
            paper["joint_share"] >= ENOUGH,
        ),
    ]


def contest(comparison: Summary) -> Contest:
    """Condense a comparison over all parameters.

    Parameters
    ----------
    comparison : comparison

    Returns
    -------
    Contest
    """
    table = comparison["parameters"]
    ratio = [row["ratio"] for row in table.values()]
    duration_a, duration_b = comparison["duration_s"]
    return Contest(
        a=comparison["a"],
        b=comparison["b"],
        median=statistics.median(ratio),
        lowest=min(ratio),
        highest=max(ratio),
        worse=tuple(name for name, row in table.items() if row["simultaneous_lower"] > 1.0),
        better=tuple(name for name, row in table.items() if row["simultaneous_upper"] < 1.0),
        time_saved_percent=100.0 * (1.0 - duration_a / duration_b),
    )


def contest_verdict(result: Contest) -> str:
    """Say in a short paragraph which campaign wins, by how much and at what cost."""
    counts = {"worse": len(result.worse), "better": len(result.better)}
    values = vars(result) | counts | {"time": time_text(result)}
    return sentence(TEMPLATES, "contest_verdict", **values)


def time_text(result: Contest) -> str:
    """Say what `a` costs in time next to `b`."""
    saved = result.time_saved_percent
    same = abs(saved) < _SAME_TIME_PERCENT
    return sentence(TEMPLATES, "contest_time", a=result.a, saved=saved, same_time=same)
