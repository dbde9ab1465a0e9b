"""What the HTML page is made of: sections, pictures and tables, as the template takes them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pipeline.page.charts import Spec
from pipeline.study.findings import ENOUGH
from pipeline.words.render import sentence

GOOD, BAD, OPEN = "good", "bad", "open"
"""How a verdict is coloured, beside its words."""

TEMPLATES = Path(__file__).parent / "templates"
"""Folder of the page and of its sentences."""

_SECTIONS = {
    "verdict": ("Verdict", "Verdict"),
    "assumptions": ("Assumptions", "What this assumes, and what that is worth"),
    "distributions": ("Errors", "How the errors are distributed"),
    "sigma": ("Sigma", "Predicted against empirical sigma"),
    "nees": ("NEES", "NEES"),
    "schedules": ("Comparison", "Campaigns against the first"),
    "convergence": ("Convergence", "How the sigmas converge"),
    "observability": ("Observability", "What each position makes observable"),
    "noise": ("Noise", "How much noise the bounds can bear"),
    "paper": ("Paper", "The paper, side by side"),
    "history": ("History", "Accuracy over time"),
    "provenance": ("Provenance", "Provenance"),
}
"""Sections in their order, by name: how the list of sections calls them, and their heading."""
_SHOWN = ("verdict", "assumptions")
"""Sections that are not folded."""

ENOUGH_TEXT = f"{100 * ENOUGH:g} %"
"""Share of runs in which a bound must hold."""


def kind_words(kind: str) -> str:
    """Kind of parameters in words."""
    return kind.replace("_", " ")


def say(block: str, /, **values: object) -> str:
    """Fill in one of the page's sentences, a block of its ``sentences.md.jinja``."""
    return sentence(TEMPLATES, block, **values)


@dataclass(frozen=True)
class Cell:
    """Cell of a table.

    Attributes
    ----------
    text : str
        With pieces of code between backticks.
    order : float or str or None
        What it is sorted by, if not by its text.
    look : str
        `GOOD`, `BAD`, `OPEN`, or nothing.
    parameter : str
        Parameter whose panel it opens.
    """

    text: str
    order: float | str | None = None
    look: str = ""
    parameter: str = ""


@dataclass(frozen=True)
class Table:
    """Table with its headings; the first `left` columns are text.

    Attributes
    ----------
    caption : str
    headings : sequence of str
    rows : sequence of sequence of Cell
    left : int
    name : str
        Id of a table that can be sorted and filtered; empty for a plain one.
    folded : bool
        Whether it is shown on demand only.
    whole : bool
        Whether its cells are kept on one line, as those of a table with a name.
    """

    caption: str
    headings: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    left: int = 1
    name: str = ""
    folded: bool = False
    whole: bool = False


@dataclass(frozen=True)
class Picture:
    """One or several charts with a sentence that says what they show.

    Attributes
    ----------
    sentence : str
    charts : mapping of str to specification
        By id.
    grid : str
        ``small`` or ``small wide``, how they stand side by side; empty for one below the other.
    """

    sentence: str
    charts: Mapping[str, Spec]
    grid: str = ""


@dataclass(frozen=True)
class Section:
    """Section of the page.

    Attributes
    ----------
    name : str
        Its id.
    lines : sequence of str
        Paragraphs above pictures and tables.
    pictures : sequence of Picture
    tables : sequence of Table
    left_out : str
        Why there is nothing in it, or less than there could be.
    preformatted : mapping of str to str
        Texts shown on demand, by their titles.
    heading : str
        If not the usual one.
    gist : str
        What it says, in a few words: all that is shown of it until it is unfolded.
    """

    name: str
    lines: Sequence[str] = ()
    pictures: Sequence[Picture] = ()
    tables: Sequence[Table] = ()
    left_out: str = ""
    preformatted: Mapping[str, str] = field(default_factory=dict)
    heading: str = ""
    gist: str = ""

    @property
    def title(self) -> str:
        """Heading of the section."""
        return self.heading or _SECTIONS[self.name][1]

    @property
    def folded(self) -> bool:
        """Whether it is shown on demand only."""
        return self.name not in _SHOWN

    @property
    def short(self) -> str:
        """Text of the link to it."""
        return _SECTIONS[self.name][0]


def cells(texts: Sequence[Any]) -> list[Cell]:
    """Make a row of plain cells."""
    return [Cell(str(text)) for text in texts]
