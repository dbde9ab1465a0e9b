"""Verdicts on what the paper claims: words decided by numbers, the same in every paper stage."""

from dataclasses import dataclass

from scipy.special import ndtri

from pipeline.words import markdown as md

MET, NOT_MET, UNDECIDED = "met", "not met", "cannot be judged"


@dataclass(frozen=True)
class Verdict:
    """A claim, what was found, and the word that follows from it."""

    claim: str
    found: str
    word: str


def sigmas_of(share: float) -> float:
    """Standard deviations within which a share of normal errors stays."""
    return float(ndtri(0.5 * (1.0 + share)))


def judged(claim: str, met: bool, text: str) -> Verdict:
    """Judge a claim that holds or does not."""
    return Verdict(claim, text, MET if met else NOT_MET)


def within(claim: str, value: float, limit: float, text: str) -> Verdict:
    """Judge a claim that something stays below a limit."""
    return judged(claim, value <= limit, text)


def near(claim: str, value: float, expected: float, tolerance: float, text: str) -> Verdict:
    """Judge a claim of a size: met within `tolerance`, a share of `expected`."""
    close = abs(value - expected) <= tolerance * abs(expected)
    return judged(claim, close, text)


def share(claim: str, lower: float, upper: float, needed: float, text: str) -> Verdict:
    """Judge a claim that holds in a share of runs, of which only an interval is known."""
    if lower >= needed:
        return Verdict(claim, text, MET)
    if upper < needed:
        return Verdict(claim, text, NOT_MET)
    because = f"the interval from {md.percent(lower)} to {md.percent(upper)} spans the limit"
    return Verdict(claim, text, f"{UNDECIDED}, because {because}")


def table(verdicts: list[Verdict]) -> str:
    """Write verdicts as a Markdown table."""
    rows = [(v.claim, v.found, f"**{v.word}**") for v in verdicts]
    return md.table(("claim", "found", "verdict"), rows, 3)
