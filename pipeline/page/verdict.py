"""Section `verdict` of the HTML page: the parameters of one campaign against their bounds.

A bound is met, or not, if the whole 95 % interval of the share of runs within it says so.
"""

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any

from inscal.parameters import NAMES
from pipeline.page.data import Campaign
from pipeline.page.parts import BAD, GOOD, OPEN, Cell, Section, Table
from pipeline.study import findings
from pipeline.study.findings import ENOUGH, HONEST, RATIO_BAND, Summary
from pipeline.study.verdict import MET, NOT_MET, UNDECIDED, share_word
from pipeline.words import markdown as md

TOO_SMALL, TOO_LARGE = "too small", "too large"
NOT_ESTIMATED = "not estimated"

_LOOKS = {
    **{MET: GOOD, NOT_MET: BAD, UNDECIDED: OPEN},
    **{HONEST: GOOD, TOO_SMALL: BAD, TOO_LARGE: BAD, NOT_ESTIMATED: OPEN},
}
_PERCENT = f"{100 * ENOUGH:g} %"


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
    return (
        f"The bounds are {findings.bounds_word(summary)}: all {len(summary['parameters'])} hold at "
        f"once in {findings.joint_text(summary)} of {made} runs, where {_PERCENT} is asked for."
    )


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
        "Verdict",
        lines=(
            f"One by one, of {len(rows)} bounds: {counts}. A bound is {MET} if the whole 95 % "
            f"interval of the share of runs within it is at or above {_PERCENT}, {NOT_MET} if it "
            f"is below, and {UNDECIDED} from these runs if it spans {_PERCENT}.",
            f"Sigma is {HONEST} unless the 95 % interval of RMSE over predicted lies wholly "
            f"outside {RATIO_BAND[0]:.2f} to {RATIO_BAND[1]:.2f}. Choose a parameter for its "
            "errors, correlations and convergence.",
        ),
        tables=(
            Table(
                f"{campaign.name}: {summary['runs_done']} runs, in parentheses 95 % intervals",
                (
                    *("parameter", "unit", "bound", "RMSE", "predicted sigma"),
                    *("RMSE / predicted", "within bound", "bound met?"),
                    "sigma honest?",
                ),
                [
                    _row(name, unit, rows[name])
                    for name, unit in zip(NAMES, campaign.units, strict=True)
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
