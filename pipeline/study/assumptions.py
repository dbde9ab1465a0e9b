"""What the results assume, and what becomes of them where an assumption is wrong."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.study import findings
from pipeline.study.names import ASSUMPTIONS
from pipeline.words import markdown as md

PATH = Path("results/disturbances.json")
"""What stage `disturbances` found."""

HEADINGS = ("assumption", "worst of those tried", "NEES", "true / formal sigma", "all bounds kept")


def read() -> dict[str, Any] | None:
    """Read what campaigns with one disturbance each have shown; None if there are none.

    Raises
    ------
    DataError
        If it cannot be read.
    """
    return findings.read_json(PATH, "disturbances") if PATH.exists() else None


def rows(found: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Rows of a table: each assumption, and the disturbance that does most against it.

    Parameters
    ----------
    found : mapping
        Of `read`.

    Returns
    -------
    list of tuple of str
        The cells of `HEADINGS`; the first row is with no disturbance, the last with all.
    """
    none, *alone, every = found["campaigns"]
    out = [("all of these", "", *_cells(none))]
    for words, keys in ASSUMPTIONS.items():
        tried = [row for row in alone if row["name"] in keys]
        if tried:
            worst = max(tried, key=lambda row: row.get("nees", np.inf))
            called = f"{md.code(worst['name'])} {worst['size']:g} (of {len(tried)})"
            out.append((words, called, *_cells(worst)))
    return [*out, ("none of these", f"all {len(alone)}", *_cells(every))]


def _cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    if not row["runs_done"]:
        return ("every run fails",) * 3
    ratio = f"{row['worst_rmse_over_formal']:.2f} ({md.code(row['worst'])})"
    return f"{row['nees']:.4g}", ratio, findings.joint_text(row)
