"""Verdicts: a claim, what was found, and a word decided by numbers; the same kind everywhere."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from pipeline.words import markdown as md

MET, NOT_MET, UNDECIDED = "met", "not met", "cannot be judged"


@dataclass(frozen=True)
class Verdict:
    """A claim, what was found, and the word that follows from it."""

    claim: str
    found: str
    word: str

    @property
    def met(self) -> bool:
        """Whether the claim holds; not so of one that cannot be judged."""
        return self.word == MET


def judged(claim: str, found: str, met: bool) -> Verdict:
    """Judge a claim that either holds or does not."""
    return Verdict(claim, found, MET if met else NOT_MET)


def within(claim: str, value: float, limit: float, text: str) -> Verdict:
    """Judge a claim that something stays below a limit."""
    return judged(claim, text, value <= limit)


def near(claim: str, value: float, expected: float, tolerance: float, text: str) -> Verdict:
    """Judge a claim of a size: met within `tolerance`, a share of `expected`."""
    return judged(claim, text, abs(value - expected) <= tolerance * abs(expected))


def share(claim: str, lower: float, upper: float, needed: float, text: str) -> Verdict:
    """Judge a claim that holds in a share of runs, of which only an interval is known."""
    word = share_word(lower, upper, needed)
    if word == UNDECIDED:
        word += f", because the interval from {md.percent(lower)} to {md.percent(upper)} spans "
        word += "the limit"
    return Verdict(claim, text, word)


def share_word(lower: float, upper: float, needed: float) -> str:
    """Judge a share of which an interval is known: it must be wholly on one side of `needed`."""
    if lower >= needed:
        return MET
    return NOT_MET if upper < needed else UNDECIDED


def table(verdicts: Iterable[Verdict], heading: str = "claim", plain: Sequence[str] = ()) -> str:
    """Write verdicts as a Markdown table.

    Parameters
    ----------
    verdicts : iterable of Verdict
    heading : str
        Of the claims.
    plain : sequence of str
        Words that are not set in bold.

    Returns
    -------
    str
    """
    rows = [(v.claim, v.found, v.word if v.word in plain else f"**{v.word}**") for v in verdicts]
    return md.table((heading, "found", "verdict"), rows, 3)
