"""Tables on the terminal: never wider than the narrowest usual window, whatever the window."""

import textwrap
from bisect import bisect_left
from collections.abc import Iterable, Sequence

from rich import box
from rich.console import Console
from rich.table import Column, Table

WIDTH = 80
"""Columns of the widest line."""
_NO_BREAK = "\N{NO-BREAK SPACE}%"


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
    """Print a title and a table on standard output, folded where it is too wide for one."""
    print(title)
    for part in _folded(table):
        _Console(width=max(WIDTH, _width(part))).print(part)


def _folded(table: Table) -> list[Table]:
    """Tables that fit, each with the first column and some of the others."""
    parts = _parts(table, WIDTH)
    if len(parts) == 1:
        return [table]
    # the narrowest that takes no more parts: what fits a room fits a wider one
    even = bisect_left(range(WIDTH), True, key=lambda room: len(_parts(table, room)) <= len(parts))
    return _parts(table, even)


def _parts(table: Table, room: int) -> list[Table]:
    """As many columns in each table as there is room for, one at least beside the first."""
    first, *others = table.columns
    parts: list[list[Column]] = [[first]]
    for column in others:
        if len(parts[-1]) > 1 and _width(_of(table, [*parts[-1], column])) > room:
            parts.append([first])
        parts[-1].append(column)
    return [_of(table, part) for part in parts]


def _of(table: Table, columns: Sequence[Column]) -> Table:
    out = Table(box=table.box, padding=table.padding)
    for column in columns:
        out.add_column(column.header, justify=column.justify, no_wrap=True)
    for row in zip(*(column.cells for column in columns), strict=True):
        out.add_row(*row)
    return out


def _width(table: Table) -> int:
    return Console(width=100 * WIDTH).measure(table).maximum


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
    whole = text.replace(" %", _NO_BREAK)
    lines = textwrap.fill(whole, WIDTH, subsequent_indent=indent, break_long_words=False)
    print(lines.replace(_NO_BREAK, " %"))


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
