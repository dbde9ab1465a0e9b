"""Pieces of Markdown text, and numbers as they read in it."""

from collections.abc import Iterable, Sequence

_LARGE = 1e4


def table(headings: Sequence[str], rows: Iterable[Sequence[str]], left: int) -> str:
    """Make a table, its first `left` columns aligned as text and the others as numbers."""
    rule = ["---"] * left + ["---:"] * (len(headings) - left)
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (headings, rule, *rows))


def bullets(lines: Iterable[str]) -> str:
    """Make a list of lines."""
    return "\n".join(f"- {line}" for line in lines)


def listed(values: Iterable[object]) -> str:
    """Write values one after the other."""
    return ", ".join(map(str, values))


def code(text: str) -> str:
    """Set a name off from the text."""
    return f"`{text}`"


def codes(names: Iterable[str]) -> str:
    """Set several names off from the text."""
    return listed(map(code, names))


def named(names: Sequence[str]) -> str:
    """Put names in parentheses after their count; nothing if there are none."""
    return f" ({codes(names)})" if names else ""


def percent(share: float) -> str:
    """Write a share between 0 and 1 in percent."""
    return f"{100 * share:.1f} %"


def number(value: float, decimals: int = 2) -> str:
    """Write a number with some decimals; in scientific form where it is far too large for them."""
    return f"{value:.{decimals}f}" if abs(value) < _LARGE else f"{value:.3g}"


def share(value: float, lower: float, upper: float) -> str:
    """Write a share and its interval in percent."""
    return f"{percent(value)} ({100 * lower:.1f} to {100 * upper:.1f})"


def sizes(values: float | Sequence[float]) -> str:
    """Write one number, or several; equal ones once."""
    several = list(values) if isinstance(values, Sequence) else [values]
    return ", ".join(f"{v:g}" for v in (several if len(set(several)) > 1 else several[:1]))


def spread(values: Sequence[float]) -> str:
    """Write one number for all if they are alike, such as 500, or from which to which they go."""
    low, high = min(values), max(values)
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def ends(values: Iterable[int]) -> str:
    """Write the smallest and the largest number; one if they are equal."""
    ordered = sorted(set(values))
    return f"{ordered[0]} to {ordered[-1]}" if len(ordered) > 1 else str(ordered[0])
