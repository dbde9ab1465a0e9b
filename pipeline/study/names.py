"""The study by name: which campaigns there are, and which of them answers what.

All of it is read from ``conf/study.yaml``.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from pipeline.console import conf

RUNS = Path("results/runs")
"""Folder of the campaign stores."""


@cache
def study() -> Mapping[str, Any]:
    """Content of ``conf/study.yaml``."""
    return yaml.safe_load(conf.find("study.yaml").read_text(encoding="utf-8"))


def role(name: str) -> str:
    """Campaign that a question is asked of: main, one_pass, paper_truth or consistency."""
    return study()["roles"][name]


MAIN, ONE_PASS, PAPER_TRUTH = role("main"), role("one_pass"), role("paper_truth")
"""Campaigns that verdicts speak of."""

BETTER = role("better")
"""Comparison that answers which schedule is better."""

CAMPAIGNS: tuple[str, ...] = tuple(study()["reported"])
"""Campaigns reported on, in their order."""

LEVELS: Mapping[str, list[str]] = study()["levels"]
"""Campaigns that differ in their noise alone, by schedule."""

MAIN_LEVELS: Sequence[str] = LEVELS[study()["campaigns"][MAIN]["schedule"]]
"""Those on the path of `MAIN`."""

COMPARISONS: Mapping[str, str] = {
    name: row["title"] for name, row in study()["comparisons"].items()
}
"""Comparisons reported on, and their headings."""

DRAWN: Mapping[str, str] = {name: COMPARISONS[name] for name in study()["drawn"]}
"""Those in the figure of schedules."""

ASSUMPTIONS: Mapping[str, Sequence[str]] = study()["assumptions"]
"""What results assume, in words, and the keys of the disturbances that take it away."""
