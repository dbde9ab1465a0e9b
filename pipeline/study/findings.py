"""Summaries and comparisons read back from their JSON files, and the verdicts they lead to.

A summary or comparison is a plain dict, as `pipeline.campaign.judged.as_json` wrote it. Nothing
here knows a result: every verdict is a threshold applied to the numbers handed in.
"""

import statistics
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.campaign import store
from pipeline.console.errors import DataError
from pipeline.console.output import is_as_signed, json_data
from pipeline.study import honesty
from pipeline.study.honesty import Summary, ratios
from pipeline.study.names import CAMPAIGNS, COMPARISONS, MAIN, PAPER_TRUTH, RUNS
from pipeline.study.verdict import MET, Verdict, share, share_word
from pipeline.words import markdown as md
from pipeline.words.render import sentence

TEMPLATES = Path(__file__).parent / "templates"
"""Folder of the texts on the study."""

ENOUGH = 0.99
"""Share of runs from which on a bound counts as met, where the configuration says nothing else."""

SUMMARY_FOLDER = Path("results/summary")
_COMPARISON_FOLDER = Path("results/comparison")
_JOINT = (
    *("joint_share_a", "joint_share_b", "joint_difference"),
    *("joint_difference_lower", "joint_difference_upper", "runs_judged"),
)
_SAME_TIME_PERCENT = 0.1  # a smaller difference is rounding of the position time


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
    joint : mapping or None
        Shares of runs that keep all bounds, as `inscal.summary.compare` has them; None where they
        were not compared.
    """

    a: str
    b: str
    median: float
    lowest: float
    highest: float
    worse: tuple[str, ...]
    better: tuple[str, ...]
    time_saved_percent: float
    joint: Mapping[str, float] | None = None


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
        If it is missing or not as it was written.
    """
    try:
        found = json_data(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise DataError(f"{path}: not found; make it with pipeline.{stage}") from None
    except (OSError, ValueError):
        raise DataError(f"{path}: cannot be read; make it anew with pipeline.{stage}") from None
    if not is_as_signed(found):
        raise DataError(f"{path}: is not as it was written; make it anew with pipeline.{stage}")
    return found


def read_summary(name: str) -> dict[str, Any]:
    """Read the summary of a campaign; DataError if there is none."""
    return read_json(SUMMARY_FOLDER / f"{name}.json", "summarize")


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
    disturbances : mapping or None
        Of `pipeline.study.assumptions.read`.
    """

    summaries: Mapping[str, Summary]
    comparisons: Mapping[str, Summary]
    configuration: Mapping[str, Any]
    disturbances: Mapping[str, Any] | None = None


def collect(disturbances: Mapping[str, Any] | None = None) -> Results:
    """Read what the report is made of.

    Parameters
    ----------
    disturbances : mapping or None
        Of `pipeline.study.assumptions.read`.

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
        disturbances,
    )


def ratio_interval(row: Mapping[str, float]) -> tuple[float, float]:
    """95 % interval of a parameter's RMSE over predicted standard deviation."""
    return row["rmse_lower"] / row["predicted_std"], row["rmse_upper"] / row["predicted_std"]


def least_within(summary: Summary) -> str:
    """Name the parameter that keeps its bound in the fewest runs."""
    table = summary["parameters"]
    return min(table, key=lambda name: table[name]["share_within_bound"])


def joint_text(summary: Summary) -> str:
    """Share of runs that keep all bounds at once, with its 95 % interval."""
    return md.share(*(summary[f"joint_share{end}"] for end in ("", "_lower", "_upper")))


def asked(summary: Summary, of: str = "joint") -> float:
    """Share of runs that are to keep all bounds at once; with ``each``, any bound."""
    return float(summary.get(f"{of}_share_asked", ENOUGH))


def bounds_word(summary: Summary) -> str:
    """Verdict on all bounds at once."""
    return share_word(summary["joint_share_lower"], summary["joint_share_upper"], asked(summary))


def bound_word(row: Mapping[str, float], needed: float = ENOUGH) -> str:
    """Verdict on the bound of one parameter."""
    limits = row["share_within_bound_lower"], row["share_within_bound_upper"]
    return share_word(*limits, needed)


def not_kept(summary: Summary) -> dict[str, str]:
    """Parameters whose bound is not met, or cannot be judged, with the word for it."""
    needed = asked(summary, "each")
    words = {name: bound_word(row, needed) for name, row in summary["parameters"].items()}
    return {name: word for name, word in words.items() if word != MET}


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
    count = len(paper["parameters"])
    return [
        *honesty.checks(MAIN, main),
        share(
            f"`{PAPER_TRUTH}`: all {count} parameters within bounds at once in at least "
            f"{100 * ENOUGH:g} % of runs",
            paper["joint_share_lower"],
            paper["joint_share_upper"],
            ENOUGH,
            joint_text(paper),
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
        joint={key: comparison[key] for key in _JOINT} if "joint_share_a" in comparison else None,
    )


def contest_verdict(result: Contest) -> str:
    """Say in a short paragraph which campaign wins, by how much and at what cost."""
    counts = {"worse": len(result.worse), "better": len(result.better)}
    values = vars(result) | counts | {"time": time_text(result), **shares(result)}
    return sentence(TEMPLATES, "contest_verdict", **values)


def shares(result: Contest) -> dict[str, Any]:
    """The two shares of runs that keep all bounds, that of the better campaign first."""
    if result.joint is None:
        return {"first": None}
    of = result.joint
    middle, low, high = (of[f"joint_difference{end}"] for end in ("", "_lower", "_upper"))
    first, second = "a", "b"
    if high < 0.0:
        first, second, middle, low, high = "b", "a", -middle, -high, -low
    return {
        "first": getattr(result, first),
        "second": getattr(result, second),
        "shares": [100.0 * of[f"joint_share_{side}"] for side in (first, second)],
        "points": [100.0 * value for value in (middle, low, high)],
        "runs": of["runs_judged"],
    }


def shares_text(result: Contest) -> str:
    """Say which campaign keeps all bounds more often; nothing where that was not compared."""
    found = shares(result)
    return sentence(TEMPLATES, "contest_shares", **found) if found["first"] else ""


def time_text(result: Contest) -> str:
    """Say what `a` costs in time next to `b`."""
    saved = result.time_saved_percent
    same = abs(saved) < _SAME_TIME_PERCENT
    return sentence(TEMPLATES, "contest_time", a=result.a, saved=saved, same_time=same)


def run_lines(about: Mapping[str, Any]) -> list[str]:
    """Say how many passes runs took, what contradicts the filter, and why runs failed.

    Of a disturbed one also its truth.
    """
    taken = ", ".join(f"{p} in {n} runs" for p, n in about.get("passes_taken", {}).items())
    lines = [f"passes: {taken}"] if taken else []
    if about.get("runs_contradicted"):
        lines.append(f"innovations contradict the filter in {about['runs_contradicted']} runs")
    why = Counter(about.get("failures", {}).values())
    lines += [f"why {count} runs failed: {reason}" for reason, count in why.items()]
    if about.get("disturbances"):
        count = len(about["disturbances"])
        lines.append(
            f"disturbance {about['disturbance']}: {count} sources; truth of a bias that wanders is "
            "its constant part"
        )
    return lines
