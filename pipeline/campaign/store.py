"""Campaign stores: one zarr group per campaign, written by one process, resumable at any moment.

The driver is the only writer. It writes values first and ``status`` last, and every chunk file is
replaced as a whole, so whatever instant a campaign is killed at, a run counts as done only if its
numbers are on disk. A resumed campaign repeats what is not marked; since a run depends on nothing
but the configuration and its number, the finished store is the same to the last bit.
"""

import json
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
import zarr
from zarr.buffer.cpu import Buffer
from zarr.storage import MemoryStore

from inscal.parameters import NAMES
from inscal.statistics import rmse_half_width_relative
from pipeline.campaign import damage, manifest
from pipeline.campaign.status import DONE, FAILED, NOT_RUN
from pipeline.campaign.template import AUGMENTED, fingerprint, template
from pipeline.config.load import undisturbed, usual_belief
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.console.errors import DataError, FailedRunsError
from pipeline.console.output import complain

if TYPE_CHECKING:
    from pipeline.campaign.worker import Batch

_NONE = np.zeros(0)
_TEXTS = ("configuration", "software", "exceptions")


@dataclass(frozen=True)
class Found:
    """What is in the place of a campaign's store.

    Attributes
    ----------
    path : Path
        Where a link leads to.
    same : bool
        Whether it is a store of this campaign.
    damaged : list of manifest.Damage
    whole : bool
        Whether it is undamaged and has all runs.
    """

    path: Path
    same: bool
    damaged: list[manifest.Damage]
    whole: bool


def look(config: Config) -> Found:
    """Look at the place of a campaign's store.

    Raises
    ------
    DataError
        If something else is in the way: other files, or a store of another configuration, unless
        `campaign.replace` allows to delete the latter.
    """
    path = Path(config.campaign.store).resolve()
    if not path.exists() or not _is_same(config, path):
        return Found(path, False, [], False)
    _, damaged = manifest.load(path)
    whole = not damaged and not len(pending(zarr.open_group(path, mode="r")))
    return Found(path, True, damaged, whole)


def open_store(
    config: Config,
    predicted_std: np.ndarray,
    augmented_std: np.ndarray = _NONE,
    found: Found | None = None,
) -> zarr.Group:
    """Open the campaign's store for writing, or make it.

    Parameters
    ----------
    config : Config
    predicted_std, augmented_std
        As `template` has them.
    found : Found, optional
        Of `look`, where that has been done.

    Returns
    -------
    zarr.Group

    Raises
    ------
    DataError
        As `look`; or if it cannot be written.
    """
    found = found or look(config)
    path = found.path
    try:
        return _opened(config, predicted_std, augmented_std, found)
    except OSError as error:
        raise DataError(
            f"campaign.store = {path}: cannot be written ({error.strerror or error})"
        ) from None


def _opened(
    config: Config, predicted_std: np.ndarray, augmented_std: np.ndarray, found: Found
) -> zarr.Group:
    path = found.path
    if found.same:
        for leftover in path.rglob("*.partial*"):  # of a write that was killed
            leftover.unlink()
        if found.damaged:
            unfinished = _beside(path, "new")
            template(config, predicted_std, augmented_std, unfinished)
            complain([damage.mend(path, unfinished, found.damaged)])
            shutil.rmtree(unfinished, ignore_errors=True)
        else:
            manifest.go_on(path, fingerprint(config))
        return zarr.open_group(path, mode="r+")
    # hidden, for a campaign of the user's may be called anything; whole folders change names, so
    # a kill in between leaves either store or none, and no half of one
    unfinished, replaced = _beside(path, "new"), _beside(path, "old")
    shutil.rmtree(replaced, ignore_errors=True)
    template(config, predicted_std, augmented_std, unfinished)
    if path.exists():
        path.rename(replaced)
    unfinished.rename(path)
    shutil.rmtree(replaced, ignore_errors=True)
    return zarr.open_group(path, mode="r+")


def _is_same(config: Config, path: Path) -> bool:
    """Whether a store is the campaign's; DataError if it is not, and may not be deleted."""
    same = _fingerprint_of(path) == fingerprint(config)
    if not same and not config.campaign.replace:
        raise DataError(
            f"campaign.store = {path}: holds a campaign of another configuration or version; "
            "choose another path, delete it, or allow it with campaign.replace=true"
        )
    return same


def _beside(path: Path, end: str) -> Path:
    return path.with_name(f".{path.name}.{end}")


def _fingerprint_of(path: Path) -> str:
    """Fingerprint of a store; DataError if `path` is none of ours."""
    try:
        about = manifest.read(path)
        if about is not None:
            return about.fingerprint
    except ValueError:
        pass  # the store itself has it too
    try:
        attributes = json.loads((path / "zarr.json").read_text(encoding="utf-8"))["attributes"]
        return str(attributes["fingerprint"])
    except (OSError, ValueError, KeyError, TypeError):
        raise DataError(f"campaign.store = {path}: exists and is not a campaign store") from None


def pending(store: zarr.Group) -> np.ndarray:
    """Numbers of the runs still to be made, ascending."""
    return np.flatnonzero(_array(store, "status")[:] == NOT_RUN)


def made(config: Config) -> int:
    """Count the runs, done or failed, of a campaign whose store may not exist yet."""
    path = Path(config.campaign.store)
    if not path.exists() or _fingerprint_of(path) != fingerprint(config):
        return 0
    return config.campaign.runs - len(pending(zarr.open_group(path, mode="r")))


def precision(store: zarr.Group, runs: int) -> tuple[float, str]:
    """Relative half-width of the 95 % interval of the least known RMSE, and whose RMSE that is.

    Parameters
    ----------
    store : zarr.Group
    runs : int
        The first of which are taken.

    Returns
    -------
    precision : float
        Infinite of fewer than two runs done.
    parameter : str
    """
    done = np.asarray(_array(store, "status")[:runs]) == DONE
    if done.sum() < 2:
        return np.inf, NAMES[0]
    width = rmse_half_width_relative(np.asarray(_array(store, "error")[:runs])[done])
    widest = int(np.argmax(width))
    return float(width[widest]), NAMES[widest]


def write(store: zarr.Group, config: Config, results: "list[tuple[list[int], Batch]]") -> None:
    """Write finished runs, neighbours together.

    Parameters
    ----------
    store : zarr.Group
    config : Config
    results : list of (run numbers, batch)
        Each of consecutive runs.

    Raises
    ------
    DataError
        If it cannot be written; what it had is kept.
    """
    if not results:
        return
    place = config.campaign.store
    try:
        _write(store, config, results)
    except (OSError, ValueError, KeyError) as error:  # of a store that was taken away meanwhile
        why = getattr(error, "strerror", None) or error
        raise DataError(
            f"campaign.store = {place}: cannot be written any more ({why}); the runs that it has "
            "are kept, and the same command goes on with them"
        ) from None


def _write(store: zarr.Group, config: Config, results: "list[tuple[list[int], Batch]]") -> None:
    from pipeline.campaign.worker import joined

    unit, augmented_unit = Setup(config).unit, Setup(config).augmented_unit
    results = sorted(results, key=lambda result: result[0][0])
    place = Path(config.campaign.store)
    manifest.begin(place, damage.files_of(store, [n for runs, _ in results for n in runs]))
    while results:
        count = 1
        while count < len(results) and results[count][0][0] == results[count - 1][0][-1] + 1:
            count += 1
        neighbours, results = results[:count], results[count:]
        part = slice(neighbours[0][0][0], neighbours[-1][0][-1] + 1)
        batch = joined([batch for _, batch in neighbours])
        outcome = batch.outcome
        truth, estimate = outcome.truth / unit, outcome.estimate / unit
        _array(store, "truth")[part] = truth
        _array(store, "estimate")[part] = estimate
        _array(store, "error")[part] = estimate - truth
        if len(augmented_unit):
            both = outcome.augmented_truth, outcome.augmented_estimate
            truth, estimate = (values / augmented_unit for values in both)
            for name, values in zip(AUGMENTED, (truth, estimate, estimate - truth), strict=True):
                _array(store, name)[part] = values
        for name in ("nees", "passes", "reason", "innovation_ratio"):
            _array(store, name)[part] = getattr(outcome, name)
        if batch.exceptions:
            raised = {str(number): text for number, text in batch.exceptions.items()}
            every = _decoded(store.attrs.get("exceptions", {})) | raised
            store.attrs["exceptions"] = json.dumps(
                {key: every[key] for key in sorted(every, key=int)}
            )
            manifest.sign(place)
        _array(store, "status")[part] = np.where(outcome.failed, FAILED, DONE).astype(np.int8)
    manifest.end(place)


def counts(store: zarr.Group) -> tuple[int, int]:
    """Count the runs done, and those failed."""
    status = np.asarray(_array(store, "status")[:])
    return int((status == DONE).sum()), int((status == FAILED).sum())


def refuse_failures(config: Config, done: int, failed: int) -> None:
    """Raise if a campaign has more failed runs than are allowed.

    Parameters
    ----------
    config : Config
    done, failed : int
        Numbers of runs.

    Raises
    ------
    FailedRunsError
        If more of them failed than `campaign.max_failed_share` allows.
    """
    allowed, made = config.campaign.max_failed_share, done + failed
    if failed > allowed * made:
        raise FailedRunsError(
            f"{config.campaign.store}: {failed} of {made} runs failed, "
            f"{100 * failed / made:.1f} %; campaign.max_failed_share allows {100 * allowed:g} %"
        )


def _array(store: zarr.Group, name: str) -> zarr.Array:
    try:
        array = store[name]
    except (KeyError, OSError):
        raise DataError(f"campaign store {store.store}: {name} is missing") from None
    assert isinstance(array, zarr.Array)
    return array


def read(path: str | Path) -> xr.Dataset:
    """Open a campaign store for reading.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    xarray.Dataset
        Loaded into memory. Its configuration says that it is undisturbed, and believes nothing
        unusual, where the store is older than that.

    Raises
    ------
    DataError
        If there is no campaign store.
    """
    place = Path(path)
    if not place.exists():
        raise DataError(f"campaign store {path}: not found; make it with pipeline.simulate")
    _fingerprint_of(place)
    files, damaged = manifest.load(place)
    if damaged:
        raise damage.error(place, damaged)
    try:
        # of what was verified, not of the disk again
        memory = MemoryStore({key: Buffer.from_bytes(value) for key, value in files.items()})
        campaign = xr.open_zarr(memory, consolidated=False, chunks=None).load()
        damage.refuse_nonsense(place, campaign)
        for name in campaign.attrs.keys() & {*_TEXTS}:
            campaign.attrs[name] = _decoded(campaign.attrs[name])
        campaign.attrs["seed"] = int(campaign.attrs["seed"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise damage.error(place, [manifest.Damage("it", f"cannot be read ({error})")]) from None
    about = campaign.attrs["configuration"]
    about.setdefault("disturbance", dict(undisturbed()))
    about["estimator"].setdefault("believed", dict(usual_belief()))
    return campaign


def _decoded(value: Any) -> Any:
    """What an attribute says in JSON; a store of before has it as it is."""
    return json.loads(value) if isinstance(value, str) else value


def done(campaign: xr.Dataset) -> xr.Dataset:
    """Select the runs done of a campaign.

    Parameters
    ----------
    campaign : xarray.Dataset
        Of `read`.

    Returns
    -------
    xarray.Dataset
    """
    return campaign.isel(run=(campaign["status"] == DONE).to_numpy())
