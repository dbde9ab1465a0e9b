"""Tables on the terminal: never wider than a usual window, whatever the window."""

import textwrap
from collections.abc import Iterable, Sequence

from rich import box
from rich.console import Console
from rich.table import Table

WIDTH = 100
"""Columns of the widest line; what does not fit in a table is in the stage's files."""


def new_table(left: tuple[str, ...], right: tuple[str, ...], gap: int = 2) -> Table:
    """Make a table without rows.

    Parameters
    ----------
    left, right : tuple of str
        Headings of the columns of text, and behind them of numbers.
    gap : int
        Spaces between columns, 1 or more.

    Returns
    -------
    rich.table.Table
    """
    table = Table(box=box.SIMPLE_HEAD, padding=(0, gap - 1, 0, 0))
    for heading in left:
        table.add_column(heading, no_wrap=True)
    for heading in right:
        table.add_column(heading, justify="right", no_wrap=True)
    return table


class _Console(Console):
    """Leaves a reader who has read enough to the stage's runner."""

    def on_broken_pipe(self) -> None:
        raise BrokenPipeError


def show(title: str, table: Table) -> None:
    """Print a title and a table on standard output."""
    needed = Console(width=10 * WIDTH).measure(table).maximum
    print(title)
    _Console(width=max(WIDTH, needed)).print(table)  # rather too wide than with numbers cut off


def show_rows(
    title: str, left: Sequence[str], right: Sequence[str], rows: Iterable[Sequence[str]]
) -> None:
    """Print a table of texts under a title; headings as of `new_table`."""
    table = new_table(tuple(left), tuple(right))
    for row in rows:
        table.add_row(*row)
    show(title, table)


def say(text: str, indent: str = "") -> None:
    """Print a paragraph on standard output, its second and later lines indented."""
    print(textwrap.fill(text, WIDTH, subsequent_indent=indent, break_long_words=False))


def show_augmented(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table of augmented states that do not wander.

    Parameters
    ----------
    headings : sequence of str
        After those of name and unit.
    rows : iterable of sequence of str
        Name, unit, and a cell for each heading.
    """
    title = "augmented states that do not wander"
    show_rows(title, ("augmented state", "unit"), headings, rows)
