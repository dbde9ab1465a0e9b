"""What the HTML page is made of: sections, pictures and tables, as the template takes them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pipeline.page.charts import Spec

GOOD, BAD, OPEN = "good", "bad", "open"
"""How a verdict is coloured, beside its words."""


_SHORT = {
    "verdict": "Verdict",
    "distributions": "Errors",
    "sigma": "Sigma",
    "nees": "NEES",
    "schedules": "Comparison",
    "convergence": "Convergence",
    "observability": "Observability",
    "noise": "Noise",
    "paper": "Paper",
    "history": "History",
    "provenance": "Provenance",
}
"""Sections in their order, by name, and how the list of sections calls them."""


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
    """

    caption: str
    headings: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    left: int = 1
    name: str = ""
    folded: bool = False


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
    name, title : str
        Id and heading.
    lines : sequence of str
        Paragraphs above pictures and tables.
    pictures : sequence of Picture
    tables : sequence of Table
    left_out : str
        Why there is nothing in it, or less than there could be.
    preformatted : mapping of str to str
        Texts shown on demand, by their titles.
    """

    name: str
    title: str
    lines: Sequence[str] = ()
    pictures: Sequence[Picture] = ()
    tables: Sequence[Table] = ()
    left_out: str = ""
    preformatted: Mapping[str, str] = field(default_factory=dict)

    @property
    def short(self) -> str:
        """Text of the link to it."""
        return _SHORT[self.name]


def cells(texts: Sequence[Any]) -> list[Cell]:
    """Make a row of plain cells."""
    return [Cell(str(text)) for text in texts]
