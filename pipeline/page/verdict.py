"""Section `verdict` of the HTML page: the parameters of one campaign against their bounds.

A bound is met, or not, if the whole 95 % interval of the share of runs within it says so; all of
them at once likewise.
"""

import math
from collections import Counter

from inscal.parameters import NAMES
from pipeline.page.data import units
from pipeline.page.parts import BAD, GOOD, OPEN, Cell, Section, Table, say
from pipeline.study import findings, honesty
from pipeline.study.campaign import Campaign
from pipeline.study.findings import Summary, bound_word
from pipeline.study.honesty import HONEST, TOO_LARGE, TOO_SMALL
from pipeline.study.verdict import MET, NOT_MET, UNDECIDED
from pipeline.words import markdown as md

NOT_ESTIMATED = "not estimated"
_HEADINGS = (  # verdicts first, in view on a phone too
    *("parameter", "bound met?", "sigma honest?", "unit", "bound", "RMSE"),
    *("predicted sigma", "RMSE / predicted", "within bound"),
)

_LOOKS = {
    **{MET: GOOD, NOT_MET: BAD, UNDECIDED: OPEN},
    **{HONEST: GOOD, TOO_SMALL: BAD, TOO_LARGE: BAD, NOT_ESTIMATED: OPEN},
}


def look(word: str) -> str:
    """Colour of a verdict that begins with one of the words above; nothing of other texts."""
    return next((_LOOKS[known] for known in _LOOKS if word.startswith(known)), "")


def sigma_verdict(summary: Summary, name: str) -> str:
    """Say whether the sigma that the filter claims for a parameter is its scatter."""
    if not summary["parameters"][name]["predicted_std"] > 0.0:
        return NOT_ESTIMATED
    return honesty.sigma_word(summary, name)


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
    needed = findings.asked(summary, "each")
    rows = [
        _row(summary, name, unit, needed) for name, unit in zip(NAMES, units(campaign), strict=True)
    ]
    exceptions = [row for row in rows if [cell.look for cell in row[1:3]] != [GOOD, GOOD]]
    words = Counter(row[1].text for row in rows)
    runs, modelled = summary["runs_done"], findings.degrees_of_freedom(summary)
    counts = ", ".join(f"{words[word]} {word}" for word in (MET, NOT_MET, UNDECIDED))
    count = {"exceptions": len(exceptions), "count": len(rows)}
    caption = say("all_parameters", name=campaign.name, runs=converged(summary), **count)
    few = len(exceptions) < len(rows)
    every = Table(caption, _HEADINGS, rows, 4, name="parameters", folded=few)
    first = Table(say("exceptions", **count), _HEADINGS, exceptions, 4, whole=True)
    return Section(
        "verdict",
        lines=(
            say("one_by_one", count=len(rows), counts=counts, enough=f"{100 * needed:g} %"),
            say(
                "sigma_honest",
                limits=honesty.ratio_limits(runs, modelled),
                sight=honesty.sight(runs, modelled),
                level=honesty.LEVEL,
                power=honesty.POWER,
                blind=honesty.BLIND,
                runs=runs,
            ),
        ),
        tables=(first, every) if few and exceptions else (every,),
    )


def _row(summary: Summary, name: str, unit: str, needed: float) -> list[Cell]:
    row = summary["parameters"][name]
    ratio, share = row["rmse_over_predicted"], row["share_within_bound"]
    if math.isfinite(ratio):
        low, high = findings.ratio_interval(row)
        ratio_cell = Cell(f"{ratio:.3f} ({low:.2f} to {high:.2f})", ratio)
    else:
        ratio_cell = Cell("–", -1.0)
    within = md.share(share, row["share_within_bound_lower"], row["share_within_bound_upper"])
    bound = bound_word(row, needed)
    sigma = sigma_verdict(summary, name)
    return [
        Cell(name, parameter=name),
        Cell(bound, look=look(bound)),
        Cell(sigma, look=look(sigma)),
        Cell(unit),
        Cell(f"{row['bound']:g}", row["bound"]),
        Cell(f"{row['rmse']:.3g}", row["rmse"]),
        Cell(f"{row['predicted_std']:.3g}", row["predicted_std"]),
        ratio_cell,
        Cell(within, share),
    ]
