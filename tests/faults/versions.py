"""The tests and one campaign under other versions of Python and of the dependencies.

Usage: ``python tests/faults/versions.py python3.12 [locked|oldest|newest]``

Works in a folder of its own that it makes: a clone of what is committed, with its own environment.
``oldest`` takes every dependency at the lower bound that ``pyproject.toml`` allows, ``newest`` what
the index has today, ``locked`` what ``constraints.txt`` names. Ends with 0 if all tests pass and
the campaign agrees with that of the Python that runs this program.
"""

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import xarray as xr

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from campaigns import ROOT
from place import folder_of_its_own

TOLERANCE_SIGMA = 1e-6  # an estimate may round otherwise by this share of its own uncertainty
_LISTS = ("campaigns", "run", "slurm", "docs")


def lower_bounds(project: dict) -> list[str]:
    """Constraints that pin every dependency of a user to the lower bound it is allowed."""
    extras = project["optional-dependencies"]
    listed = [*project["dependencies"], *(line for name in _LISTS for line in extras[name])]
    names = [line.partition(",")[0] for line in listed if ">=" in line]
    return [name.replace(">=", "==") for name in names]


def constraints(which: str, folder: Path) -> list[str]:
    """Arguments of pip that choose the versions."""
    if which == "newest":
        return []
    if which == "locked":
        return ["-c", str(ROOT / "constraints.txt")]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    file = folder / "oldest.txt"
    file.write_text("\n".join(lower_bounds(project)), encoding="utf-8")
    return ["-c", str(file)]


def environment(python: str, which: str, folder: Path) -> Path:
    """A clone with its environment; the interpreter of it."""
    clone, inside = folder / "inscal", folder / "environment"
    subprocess.run(["git", "clone", "--quiet", ROOT, clone], check=True)
    subprocess.run([python, "-m", "venv", inside], check=True)
    own = inside / "bin" / "python"
    install = [own, "-m", "pip", "install", "--quiet", *constraints(which, folder)]
    subprocess.run([*install, "-e", f"{clone}[dev]"], check=True)
    return own


def campaign(python: Path | str, clone: Path, path: Path) -> xr.Dataset:
    """What a campaign finds that the Python given runs in a clone."""
    words = ["-m", "pipeline.simulate", "campaign.runs=64", f"campaign.store={path}"]
    subprocess.run([python, *words], cwd=clone, env=_alone(), check=True, capture_output=True)
    return xr.open_zarr(path).load()


def _alone() -> dict[str, str]:
    """The environment without what points to other checkouts."""
    return {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}


def main(python: str, which: str = "locked") -> int:
    """Install, run, compare and print."""
    folder = folder_of_its_own()
    try:
        own = environment(python, which, folder)
        clone = folder / "inscal"
        here = campaign(sys.executable, ROOT, folder / "here")
        there = campaign(own, clone, folder / "there")
        apart = float(np.abs((there.error - here.error) / here.predicted_std).max())
        path = f"{own.parent}:{os.environ['PATH']}"
        tested = subprocess.run(
            [own, "-m", "pytest"],
            cwd=clone,
            env={**_alone(), "PATH": path},
            capture_output=True,
            text=True,
        )
    finally:
        shutil.rmtree(folder)
    last = tested.stdout.strip().splitlines()
    print("\n".join(line for line in last if line.startswith(("FAILED", "ERROR"))))
    print(f"{python}, {which}: {last[-1]}; estimates {apart:.1e} sigma apart")
    return int(tested.returncode != 0 or apart > TOLERANCE_SIGMA)


if __name__ == "__main__":
    raise SystemExit(main(*sys.argv[1:]))
