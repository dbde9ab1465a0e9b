"""Section `verdict` of the HTML page: the parameters of one campaign against their bounds.

A bound is met, or not, if the whole 95 % interval of the share of runs within it says so.
"""

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any

from inscal.parameters import NAMES
from pipeline.page.data import units
from pipeline.page.parts import BAD, ENOUGH_TEXT, GOOD, OPEN, Cell, Section, Table, say
from pipeline.study import findings
from pipeline.study.campaign import Campaign
from pipeline.study.findings import ENOUGH, HONEST, RATIO_BAND, Summary
from pipeline.study.verdict import MET, NOT_MET, UNDECIDED, share_word
from pipeline.words import markdown as md

TOO_SMALL, TOO_LARGE = "too small", "too large"
NOT_ESTIMATED = "not estimated"

_LOOKS = {
    **{MET: GOOD, NOT_MET: BAD, UNDECIDED: OPEN},
    **{HONEST: GOOD, TOO_SMALL: BAD, TOO_LARGE: BAD, NOT_ESTIMATED: OPEN},
}


def look(word: str) -> str:
    """Colour of a verdict that begins with one of the words above; nothing of other texts."""
    return next((_LOOKS[known] for known in _LOOKS if word.startswith(known)), "")


def bound_verdict(row: Mapping[str, float]) -> str:
    """Say whether a parameter keeps its bound in enough runs."""
    return share_word(row["share_within_bound_lower"], row["share_within_bound_upper"], ENOUGH)


def sigma_verdict(row: Mapping[str, float]) -> str:
    """Say whether the sigma that the filter claims for a parameter is its scatter."""
    if not row["predicted_std"] > 0.0:
        return NOT_ESTIMATED
    (lower, upper), (low, high) = findings.ratio_interval(row), RATIO_BAND
    return TOO_SMALL if lower > high else TOO_LARGE if upper < low else HONEST


def headline(summary: Summary) -> str:
    """Say in a sentence whether all bounds are met at once, of all runs made."""
    made = summary["runs_done"] + summary["runs_failed"]
    return say(
        "headline",
        word=findings.bounds_word(summary),
        count=len(summary["parameters"]),
        joint=findings.joint_text(summary),
        made=made,
        failed=summary["runs_failed"],
        contradicted=summary.get("runs_contradicted", 0),
        enough=ENOUGH_TEXT,
    )


def converged(summary: Summary) -> str:
    """Say of how many runs the statistics are."""
    done, failed = summary["runs_done"], summary["runs_failed"]
    return f"{done} runs that converged, of {done + failed}" if failed else f"{done} runs"


def section(campaign: Campaign) -> Section:
    """Make the section.

    Parameters
    ----------
    campaign : Campaign

    Returns
    -------
    Section
    """
    summary = campaign.summary
    rows = summary["parameters"]
    words = Counter(bound_verdict(row) for row in rows.values())
    counts = ", ".join(f"{words[word]} {word}" for word in (MET, NOT_MET, UNDECIDED))
    return Section(
        "verdict",
        lines=(
            say("one_by_one", count=len(rows), counts=counts, enough=ENOUGH_TEXT),
            say("sigma_honest", band=RATIO_BAND),
        ),
        tables=(
            Table(
                f"{campaign.name}: {converged(summary)}, in parentheses 95 % intervals",
                (
                    *("parameter", "unit", "bound", "RMSE", "predicted sigma"),
                    *("RMSE / predicted", "within bound", "bound met?"),
                    "sigma honest?",
                ),
                [
                    _row(name, unit, rows[name])
                    for name, unit in zip(NAMES, units(campaign), strict=True)
                ],
                2,
                name="parameters",
            ),
        ),
    )


def _row(name: str, unit: str, row: Mapping[str, Any]) -> list[Cell]:
    ratio, share = row["rmse_over_predicted"], row["share_within_bound"]
    if math.isfinite(ratio):
        low, high = findings.ratio_interval(row)
        ratio_cell = Cell(f"{ratio:.3f} ({low:.2f} to {high:.2f})", ratio)
    else:
        ratio_cell = Cell("–", -1.0)
    within = md.share(share, row["share_within_bound_lower"], row["share_within_bound_upper"])
    bound, sigma = bound_verdict(row), sigma_verdict(row)
    return [
        Cell(name, parameter=name),
        Cell(unit),
        Cell(f"{row['bound']:g}", row["bound"]),
        Cell(f"{row['rmse']:.3g}", row["rmse"]),
        Cell(f"{row['predicted_std']:.3g}", row["predicted_std"]),
        ratio_cell,
        Cell(within, share),
        Cell(bound, look=look(bound)),
        Cell(sigma, look=look(sigma)),
    ]
