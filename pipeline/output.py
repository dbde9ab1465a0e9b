"""Small files and lines a stage leaves."""

import sys
from collections.abc import Iterable
from pathlib import Path

from pipeline.config import DataError


def complain(lines: Iterable[str]) -> None:
    """Print warnings on standard error."""
    for line in lines:
        print(line, file=sys.stderr)


def write_text(path: str | Path, text: str) -> None:
    """Write a text file, making its folder.

    Raises
    ------
    DataError
        If the file cannot be written.
    """
    try:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        Path(path).write_text(text)
    except OSError as error:
        raise DataError(f"{path}: cannot be written ({error.strerror})") from None
