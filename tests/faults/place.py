"""Folders that may be broken: made by these programs, and marked as theirs."""

import shutil
import tempfile
from pathlib import Path

MARK = ".damage"


def folder_of_its_own() -> Path:
    """A new folder, marked as one that may be broken."""
    folder = Path(tempfile.mkdtemp(prefix="inscal-faults-"))
    (folder / MARK).touch()
    return folder


def copy_of(good: Path, name: str = "bad") -> Path:
    """A copy to break, in the marked folder and nowhere else."""
    folder = good.parent
    if not (folder / MARK).is_file():
        raise SystemExit(f"{folder}: not a folder that this program made")
    shutil.rmtree(folder / name, ignore_errors=True)
    return Path(shutil.copytree(good, folder / name))
