"""Damaged stores: which runs are lost, and how they are made again."""

import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
import zarr

from pipeline.campaign import manifest
from pipeline.campaign.manifest import Damage
from pipeline.campaign.status import DONE, FAILED, NOT_RUN
from pipeline.console.errors import DataError

_RUN = "run"
_SHOWN = 3


def files_of(store: zarr.Group, runs: Sequence[int]) -> list[str]:
    """Files that change when these runs are written."""
    out = [manifest.ROOT]
    for name, array in store.arrays():
        if _by_run(array):
            chunks = {number // array.chunks[0] for number in runs}
            out += [_file(name, array, chunk) for chunk in chunks]
    return out


def _by_run(array: Any) -> bool:
    names = array.metadata.dimension_names
    return bool(names) and names[0] == _RUN and array.name.strip("/") != _RUN


def _file(name: str, array: Any, chunk: int) -> str:
    return "/".join([name, "c", str(chunk), *["0"] * (len(array.shape) - 1)])


def error(path: Path, found: Sequence[Damage]) -> DataError:
    """One line that names a damaged store, what of it, and how to mend it."""
    about = "; ".join(f"{one.file} {one.why}{_runs_text(path, one.file)}" for one in found[:_SHOWN])
    more = f" and {len(found) - _SHOWN} more" * (len(found) > _SHOWN)
    return DataError(
        f"campaign store {path}: damaged: {about}{more}; to mend it give the command that made it, "
        f"pipeline.simulate with campaign.store={path}, once more"
    )


def _runs_text(path: Path, name: str) -> str:
    runs = _runs_of(path, name)
    return f" (runs {runs[0]} to {runs[-1]})" if runs is not None and len(runs) else ""


def _runs_of(path: Path, name: str) -> np.ndarray | None:
    """Runs of a chunk; all of an array's metadata; None of what is not by run."""
    array, _, rest = name.partition("/")
    try:
        about = json.loads((path / array / manifest.ROOT).read_text(encoding="utf-8"))
        if about["dimension_names"][0] != _RUN or array == _RUN:
            return None
        whole = int(about["shape"][0])
        chunk = int(about["chunk_grid"]["configuration"]["chunk_shape"][0])
        if not rest.startswith("c/"):
            return np.arange(whole)
        first = int(rest.split("/")[1]) * chunk
        return np.arange(first, min(first + chunk, whole))
    except (OSError, ValueError, KeyError, TypeError, IndexError):
        return None


def mend(path: Path, template: Path, found: Sequence[Damage]) -> str:
    """Make a damaged store whole, but for runs that are to be made again.

    Parameters
    ----------
    path : Path
        The store.
    template : Path
        A store of the same campaign without any runs.
    found : sequence of Damage

    Returns
    -------
    str
        What was done.
    """
    names = [one.file for one in found]
    for name in names:
        (path / name).unlink(missing_ok=True)
    for file in template.rglob("*"):
        name = file.relative_to(template).as_posix()
        if file.is_file() and name != manifest.NAME and not _same(file, path / name):
            if name == manifest.ROOT and name not in names:
                continue  # it names exceptions too
            (path / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(file, path / name)
    store = zarr.open_group(path, mode="r+")
    if manifest.NAME in names:  # then their own checksums are all there is to go by
        names += _unreadable(path, store)
    status: Any = store["status"]
    values = np.asarray(status[:])
    lost = np.zeros(len(values), dtype=bool)
    for name in names:
        runs = _runs_of(path, name)
        if runs is not None and not name.endswith(manifest.ROOT):
            lost[runs] = True
    if manifest.ROOT in names:  # what failed runs raised was in it
        lost |= values == FAILED
    status[:] = np.where(lost, NOT_RUN, values).astype(np.int8)
    about = json.loads((template / manifest.ROOT).read_text(encoding="utf-8"))["attributes"]
    manifest.seal(path, str(about["fingerprint"]))
    return (
        f"campaign store {path}: damaged in {len(names)} files, such as {names[0]}; "
        f"{int(lost.sum())} runs are made again"
    )


def _unreadable(path: Path, store: zarr.Group) -> list[str]:
    """Chunks that are not what their own checksums say; they are removed."""
    out = []
    for name, array in store.arrays():
        for chunk in range(-(-array.shape[0] // array.chunks[0])):
            try:
                _ = array[chunk * array.chunks[0] : (chunk + 1) * array.chunks[0]]
            except (OSError, ValueError, RuntimeError):
                out.append(_file(name, array, chunk))
                (path / out[-1]).unlink(missing_ok=True)
    return out


def _same(one: Path, other: Path) -> bool:
    return other.is_file() and one.read_bytes() == other.read_bytes()


def refuse_nonsense(path: Path, campaign: xr.Dataset) -> None:
    """Raise if numbers of a store contradict each other; one of before may have no manifest.

    Raises
    ------
    DataError
        Of `error`.
    """
    status = campaign["status"].to_numpy()
    bad: dict[str, np.ndarray] = {"status": ~np.isin(status, (NOT_RUN, DONE, FAILED))}
    is_done = status == DONE
    values = {name: campaign[name].to_numpy() for name in ("truth", "estimate", "error", "nees")}
    for name, value in values.items():
        finite = np.isfinite(value).reshape(len(value), -1).all(axis=1)
        bad[name] = is_done & ~finite
    with np.errstate(invalid="ignore"):
        other = (values["error"] != values["estimate"] - values["truth"]).any(axis=1)
        bad["error"] |= is_done & other
        bad["nees"] |= is_done & ~(values["nees"] >= 0.0)
    if "passes" in campaign:
        bad["passes"] = is_done & (campaign["passes"].to_numpy() < 1)
    for name, runs in bad.items():
        if runs.any():
            number = int(campaign[_RUN].to_numpy()[runs][0])
            raise error(path, [Damage(name, f"cannot be right in run {number}")])
