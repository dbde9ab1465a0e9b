"""The file that `out` names: of the kind that a stage writes, and no one else's."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path

from pipeline.console.errors import ConfigError
from pipeline.console.output import json_data, json_text


def check(out: str | None, endings: Sequence[str]) -> None:
    """Refuse an `out` that a stage does not write, or that would replace somebody else's file.

    A file is a stage's own if it has the form that stages give their files; what is written beside
    it goes by that file, and is somebody else's where that is not there.

    Parameters
    ----------
    out : str or None
    endings : sequence of str
        Of the files that the stage writes, `out` itself first; none if it writes where it says.

    Raises
    ------
    ConfigError
        If it is refused.
    """
    if out is None:
        return
    if not endings:
        raise ConfigError(f"out = {out!r}: must be null; this stage has no file to put there")
    path, (own, *beside) = Path(out), endings
    if path.suffix != own:
        also = f"; {', '.join(beside)} files go beside it" * bool(beside)
        raise ConfigError(f"out = {out!r}: must be a file whose name ends with {own}{also}")
    if path.is_file():
        if not _OWN[own](path):
            raise ConfigError(f"out = {out!r}: must be a new file, or one that a stage wrote")
        return
    for ending in beside:
        if path.with_suffix(ending).exists():
            raise ConfigError(
                f"out = {out!r}: must be another name; {path.with_suffix(ending)} would be "
                "replaced, and no stage wrote it"
            )


def _is_json(path: Path) -> bool:
    text = path.read_text(encoding="utf-8")
    return text in (json_text(json_data(text)), json_text(json_data(text), indent=2))


def _begins(*starts: bytes) -> Callable[[Path], bool]:
    def begins(path: Path) -> bool:
        with path.open("rb") as file:
            return file.read(1 << 12).startswith(starts)

    return begins


def _guarded(test: Callable[[Path], bool]) -> Callable[[Path], bool]:
    def guarded(path: Path) -> bool:
        try:
            return test(path)
        except (OSError, ValueError, RecursionError, json.JSONDecodeError):
            return False

    return guarded


_OWN = {
    ".json": _guarded(_is_json),
    ".csv": _guarded(_begins(b"parameter,")),
    ".nc": _guarded(_begins(b"CDF")),
    ".html": _guarded(_begins(b"<!DOCTYPE html>")),
}
"""Whether a file of an ending is one that a stage wrote."""
