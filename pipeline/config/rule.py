"""Rules of values: what is accepted, what is said of it, and the usual ones.

Whatever is refused, the line names the key, its value and what is allowed.
"""

import math
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NoReturn

from pipeline.console.errors import ConfigError

Rule = tuple[Callable[[Any], bool], str]
"""Whether a value is accepted, and what is allowed, in words that follow "must be"."""

LARGEST_PASSES = 100
_LEAST, _MOST = 1e-30, 1e30  # sizes of numbers
_LONGEST_NAME, _LONGEST_PATH, _SHOWN = 100, 4000, 160
_RATIO_TOLERANCE = 1e-9  # rounding of decimal seconds, as in 20.7 / 0.1


def refuse(key: str, value: object, allowed: str) -> NoReturn:
    """Raise a `ConfigError` of a value."""
    shown = "null" if value is None else repr(value)
    shown = shown if len(shown) <= _SHOWN else f"{shown[:_SHOWN]}..."
    raise ConfigError(f"{key} = {shown}: must be {allowed}")


def apply(key: str, value: object, rule: Rule) -> None:
    """Refuse a value that a rule does not accept."""
    accepts, allowed = rule
    try:
        accepted = accepts(value)
    except (TypeError, ValueError, AttributeError, OverflowError):  # of a list in a list
        accepted = False
    if not accepted:
        refuse(key, value, allowed)


def check_sizes(key: str, value: object) -> None:
    """Refuse numbers whose squares or inverses are none that double precision holds."""
    if isinstance(value, Mapping):
        for name, part in value.items():
            check_sizes(f"{key}.{name}" if key else name, part)
    elif isinstance(value, list):
        for place, part in enumerate(value):
            check_sizes(f"{key}[{place}]", part)
    elif isinstance(value, float) and math.isfinite(value) and value:
        size = abs(value)
        if size < _LEAST or size > _MOST:
            refuse(key, value, f"0, or of a size from {_LEAST:g} to {_MOST:g}")


def is_number(value: object) -> bool:
    """Whether a value is a finite number."""
    # The comparison is false for NaN, infinities and integers too large for a float.
    is_real = isinstance(value, int | float) and not isinstance(value, bool)
    return is_real and abs(value) <= sys.float_info.max  # type: ignore[arg-type]


def is_count(value: float) -> bool:
    """Whether a number is a whole one, 1 or more, but for rounding."""
    whole = is_number(value) and round(value)
    return whole >= 1 and math.isclose(value, whole, rel_tol=_RATIO_TOLERANCE)


def _is_triple_of_positive(value: object) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(POSITIVE[0](v) for v in value)


def _is_path(value: str) -> bool:
    local = re.match(r"[A-Za-z][A-Za-z0-9+.-]+://?", value) is None
    return (
        value.isprintable()
        and value == value.strip() != ""
        and local
        and len(value) <= _LONGEST_PATH
    )


def is_address(value: str) -> bool:
    """Whether a text is the address of a scheduler."""
    match = re.fullmatch(r"(?:tcp|tls)://(?:[\w.-]+|\[[0-9A-Fa-f:.]+\]):(\d{1,5})", value)
    return match is not None and 1 <= int(match[1]) <= 65535


def one_of(*names: str) -> Rule:
    """Rule that takes one of some words."""
    return (lambda value: value in names), f"one of {', '.join(names)}"


def is_range(value: str) -> bool:
    """Whether a text is a range of runs, such as ``0:128``."""
    match = re.fullmatch(r"(\d{1,9}):(\d{1,9})", value)
    return match is not None and int(match[1]) < int(match[2])


def matching(pattern: str, allowed: str) -> Rule:
    """Rule that takes text of a form."""
    return (lambda value: re.fullmatch(pattern, value) is not None), allowed


FINITE: Rule = (is_number, "a finite number")
FROM_0: Rule = (lambda v: is_number(v) and v >= 0, "a finite number >= 0")
POSITIVE: Rule = (lambda v: is_number(v) and v > 0, "a finite number > 0")
PASSES: Rule = (lambda v: 1 <= v <= 10, "an integer from 1 to 10")
MOST_PASSES: Rule = (lambda v: 1 <= v <= LARGEST_PASSES, f"an integer from 1 to {LARGEST_PASSES}")
COUNT: Rule = (lambda v: v >= 1, "an integer >= 1")
INDEX: Rule = (lambda v: 0 <= v < 2**63, "an integer >= 0, below 2^63")
STORE: Rule = (
    lambda v: _is_path(v),
    "a path, not empty, of this machine, without control characters or blanks at its ends",
)
STORES: Rule = (
    lambda v: len(set(v)) == len(v) > 0 and all(map(STORE[0], v)),
    "a list of one or more paths, each once",
)
FILE: Rule = (lambda v: _is_path(v) and not Path(v).is_dir(), "the path of a file")
REASON: Rule = (lambda v: v.strip() != "", "the reason in words, not empty")
NAME: Rule = matching(
    rf"[A-Za-z0-9][A-Za-z0-9._-]{{0,{_LONGEST_NAME - 1}}}",
    f"letters, digits, '.', '_' and '-', first a letter or digit, {_LONGEST_NAME} at most",
)
SHARE: Rule = (lambda v: 0.0 < v < 1.0, "a number between 0 and 1")
TRIPLE_OF_POSITIVE: Rule = (_is_triple_of_positive, "a list of 3 finite numbers > 0")


def several(rule: Rule) -> Rule:
    """Rule that takes a list whose every member another rule takes."""
    accepts, allowed = rule
    return (lambda v: len(v) > 0 and all(map(accepts, v))), f"a list, each of it {allowed}"
