"""The one answer, the same on the terminal, in reports and on pages."""

import math
from typing import Any

from pipeline.study import findings
from pipeline.study.findings import Contest, Summary
from pipeline.study.honesty import honesty
from pipeline.study.verdict import NOT_MET, UNDECIDED
from pipeline.words.render import sentence

_Z_SQUARED = 3.841458820694124  # of a 95 % interval


def headline(summary: Summary, contest: Contest | None = None) -> str:
    """Say whether the bounds are met, whether the filter is honest, and which schedule is better.

    Parameters
    ----------
    summary : summary
        Of one campaign.
    contest : Contest or None
        Of it and another one, if there is one.

    Returns
    -------
    str
        A paragraph without Markdown, which begins with what it is about and under what assumptions.
    """
    made, asked = summary["runs_done"] + summary["runs_failed"], findings.asked(summary)
    return sentence(
        findings.TEMPLATES,
        "headline",
        campaign=summary["campaign"],
        schedule=summary["schedule"],
        noise=summary["noise"]["name"],
        disturbance=summary.get("disturbance"),
        word=findings.bounds_word(summary),
        undecided=UNDECIDED,
        count=len(summary["parameters"]),
        joint=findings.joint_text(summary),
        made=made,
        failed=summary["runs_failed"],
        contradicted=summary.get("runs_contradicted", 0),
        asked=asked,
        too_few=made < runs_needed(asked) and findings.bounds_word(summary) != NOT_MET,
        needed=runs_needed(asked),
        honesty=honesty(summary),
        **_contest(contest),
    )


def _contest(contest: Contest | None) -> dict[str, Any]:
    return findings.shares(contest) if contest else {"first": None}


def runs_needed(share: float) -> int:
    """Fewest runs that can show a share, if every one of them is within its bounds."""
    return math.ceil(_Z_SQUARED * share / (1.0 - share))
