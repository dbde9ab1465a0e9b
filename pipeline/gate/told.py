"""What the gate has found, for people, for pull requests and for machines."""

from collections.abc import Iterable
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from inscal.regression import Judgement, Loss
from pipeline.console.output import write_json, write_text
from pipeline.words import markdown as md
from pipeline.words.render import render

_TEMPLATES = Path(__file__).parent / "templates"
WORSE = "worse"


@dataclass(frozen=True)
class Told:
    """Verdict on one case.

    Attributes
    ----------
    name : str
    judgement : Judgement
    lines : list of str
        What is said of it.
    """

    name: str
    judgement: Judgement
    lines: list[str]


@dataclass(frozen=True)
class Report:
    """Verdict of the gate.

    Attributes
    ----------
    verdict : str
        One of `pipeline.gate.judge.VERDICTS`.
    runs : int
    reason : str
        Why the baseline was accepted.
    cases : list of Told
        The worst first.
    """

    verdict: str
    runs: int
    reason: str
    cases: list[Told]

    @property
    def headline(self) -> str:
        """The verdict in a line."""
        many = f" of {len(self.cases)} cases" if len(self.cases) > 1 else ""
        return f"{self.verdict}: {self.runs} runs{many} against the baseline: {self.reason}"

    def content(self) -> dict[str, Any]:
        """As JSON has it."""
        return {
            "verdict": self.verdict,
            "runs": self.runs,
            "baseline": self.reason,
            "cases": [_case(case) for case in self.cases],
        }


def _case(case: Told) -> dict[str, Any]:
    about = case.judgement
    return {
        "name": case.name,
        "verdict": about.verdict,
        "same_data": about.same_data,
        "failed_runs": about.failed,
        "losses": [vars(loss) for loss in worst_first(about.losses)],
        "checks_failed": [check.name for check in about.checks if not check.passed],
        "said": case.lines,
    }


def worst_first(losses: Iterable[Loss]) -> list[Loss]:
    """Losses in the order of their size."""
    return sorted(losses, key=attrgetter("ratio"), reverse=True)


def show(report: Report) -> None:
    """Print a report."""
    print(report.headline)
    for case in report.cases:
        if case.lines and len(report.cases) > 1:
            print(f"  {case.name}: {case.judgement.verdict}")
        for line in case.lines:
            print(f"    {line}")


def write(report: Report, out: str | Path) -> None:
    """Write a report as JSON, and beside it as JUnit XML and as Markdown.

    Parameters
    ----------
    report : Report
    out : str or Path
        The JSON file; what ends with ``.xml`` is for machines that read tests, what ends with
        ``.md`` for the summary of a step.
    """
    path = Path(out)
    write_json(path, report.content())
    write_text(path.with_suffix(".xml"), _junit(report))
    rows = [(md.code(case.name), case.judgement.verdict, _loss(case)) for case in report.cases]
    page = render(_TEMPLATES, "told.md.jinja", report=report, rows=rows, worse=WORSE)
    write_text(path.with_suffix(".md"), page)


def _loss(case: Told) -> str:
    """The largest loss of a case."""
    losses = worst_first(case.judgement.losses)
    return f"{md.code(losses[0].name)} {losses[0].ratio:.3f}" if losses else ""


def _junit(report: Report) -> str:
    failed = sum(case.judgement.verdict == WORSE for case in report.cases)
    counts = {"tests": str(len(report.cases)), "failures": str(failed)}
    suite = ElementTree.Element("testsuite", {"name": "inscal regress", **counts})
    for case in report.cases:
        test = ElementTree.SubElement(suite, "testcase", classname="regress", name=case.name)
        text = "\n".join(case.lines)
        if case.judgement.verdict == WORSE:
            ElementTree.SubElement(test, "failure", message=case.judgement.verdict).text = text
        elif text:
            ElementTree.SubElement(test, "system-out").text = text
    ElementTree.indent(suite)
    return ElementTree.tostring(suite, encoding="unicode", xml_declaration=True) + "\n"
