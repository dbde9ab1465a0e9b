"""Small files and lines a stage leaves."""

import hashlib
import json
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pipeline.console import interrupts
from pipeline.console.errors import DataError

SIGNATURE = "sha256"
"""Key of a mapping's own digest."""


def complain(lines: Iterable[str]) -> None:
    """Print warnings on standard error."""
    for line in lines:
        print(line, file=sys.stderr)


@contextmanager
def written(path: str | Path) -> Iterator[Path]:
    """Make a file's folder, let the block write the file uninterrupted, and remember it.

    Raises
    ------
    DataError
        If the file cannot be written.
    """
    try:
        with interrupts.held():
            Path(path).parent.mkdir(parents=True, exist_ok=True)
            with replacing(path) as file:
                yield file
            interrupts.wrote(path)
    except OSError as error:
        raise DataError(f"{path}: cannot be written ({error.strerror or error})") from None


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Let the block write beside a file, and put what it wrote in the file's place in one step.

    Whatever ends the block, the file is the new one, whole and on disk, or still the old one. The
    name beside it has the same ending.
    """
    own = Path(path).resolve()  # what a link points to, and not the link
    if own.exists() and not own.is_file():  # such as a pipe
        yield own
        return
    beside = own.with_name(f".{own.stem}.partial{own.suffix}")
    try:
        yield beside
        with beside.open("rb") as file:
            os.fsync(file.fileno())
        beside.replace(own)
    finally:
        beside.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write a text file, making its folder; DataError if that cannot be."""
    with written(path) as file:
        file.write_text(text, encoding="utf-8")


def json_text(data: Any, *, indent: int = 1) -> str:
    """Strict JSON text of numbers, texts, lists and mappings.

    JSON has neither NaN nor infinity: NaN is null, an infinite number the text "Infinity" or
    "-Infinity".
    """
    return json.dumps(_to_strict(data), indent=indent, allow_nan=False) + "\n"


def json_data(text: str) -> Any:
    """Read what `json_text` wrote, null as NaN.

    Raises
    ------
    ValueError
        If it is no JSON.
    """
    return _from_strict(json.loads(text))


def digest(data: Any) -> str:
    """SHA-256 of data as strict JSON, whatever the order of its keys."""
    text = json.dumps(_to_strict(data), sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def signed(data: Mapping[str, Any]) -> dict[str, Any]:
    """Data with its own digest, by which `is_as_signed` sees whether it was changed."""
    rest = {key: value for key, value in data.items() if key != SIGNATURE}
    return {**rest, SIGNATURE: digest(rest)}


def is_as_signed(data: Any) -> bool:
    """Whether data is a mapping with its own digest, and unchanged since."""
    return isinstance(data, Mapping) and data.get(SIGNATURE) == signed(data)[SIGNATURE]


def write_json(path: str | Path, data: Any, *, indent: int = 1) -> None:
    """Write data as `json_text` has it, making the file's folder; DataError if that cannot be."""
    write_text(path, json_text(data, indent=indent))


def write_found(path: str | Path, data: Any, page: str) -> None:
    """Write data as JSON, its page as Markdown beside it, and print where that is."""
    beside = Path(path).with_suffix(".md")
    write_json(path, data)
    write_text(beside, page)
    print(beside)


_INFINITE = {"Infinity": math.inf, "-Infinity": -math.inf}


def _to_strict(data: Any) -> Any:
    if not isinstance(data, float):
        return _each(_to_strict, data)
    if math.isnan(data):
        return None
    return data if math.isfinite(data) else "Infinity" if data > 0 else "-Infinity"


def _from_strict(data: Any) -> Any:
    if data is None:
        return math.nan
    return _INFINITE.get(data, data) if isinstance(data, str) else _each(_from_strict, data)


def _each(change: Callable[[Any], Any], data: Any) -> Any:
    """Change every member of a list or mapping; leave anything else alone."""
    if isinstance(data, Mapping):
        return {key: change(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [change(value) for value in data]
    return data
