"""Campaign stores: one zarr group per campaign, written by one process, resumable at any moment.

The driver is the only writer. It writes values first and ``status`` last, and every chunk file is
replaced as a whole, so whatever instant a campaign is killed at, a run counts as done only if its
numbers are on disk. A resumed campaign repeats what is not marked; since a run depends on nothing
but the configuration and its number, the finished store is the same to the last bit.

Chunks are a property of the number of runs alone, few enough to keep a store small in files.
"""

import hashlib
import json
import shutil
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
import zarr
from zarr.codecs import Crc32cCodec, ZstdCodec

from inscal.parameters import COUNT, NAMES, UNITS
from inscal.statistics import rmse_half_width_relative
from pipeline.campaign import damage, manifest
from pipeline.campaign.status import DONE, FAILED, NOT_RUN
from pipeline.config.load import resolved, run_settings, undisturbed, usual_belief
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.console.errors import DataError, FailedRunsError
from pipeline.console.output import complain

if TYPE_CHECKING:
    from pipeline.campaign.worker import Batch

_CHUNKS = 12
_AUGMENTED = ("augmented_truth", "augmented_estimate", "augmented_error")
_NONE = np.zeros(0)
_SOFTWARE = ("inscal", "numpy", "scipy", "numba", "xarray", "zarr", "dask")


def fingerprint(config: Config) -> str:
    """Digest of all that decides a store's numbers: configuration and source of the library.

    Parameters
    ----------
    config : Config

    Returns
    -------
    str
        Hexadecimal SHA-256.
    """
    from inscal.kernel import source_digest  # compiles; readers of stores need not wait for it

    settings = run_settings(resolved(config)) | {"runs": config.campaign.runs}
    text = json.dumps(settings, sort_keys=True) + source_digest()
    return hashlib.sha256(text.encode()).hexdigest()


def open_store(
    config: Config, predicted_std: np.ndarray, augmented_std: np.ndarray = _NONE
) -> zarr.Group:
    """Open the campaign's store for writing, or make it.

    Parameters
    ----------
    config : Config
    predicted_std : ndarray, shape (27,)
        In paper units.
    augmented_std : ndarray, shape (n,)
        Of the augmented states that do not wander, in the units of their keys.

    Returns
    -------
    zarr.Group

    Raises
    ------
    DataError
        If something else is in the way: other files, or a store of another configuration, unless
        `campaign.replace` allows to delete the latter; or if it cannot be written.
    """
    path = Path(config.campaign.store)
    if path.exists():
        if _fingerprint_of(path) == fingerprint(config):
            for leftover in path.rglob("*.partial*"):  # of a write that was killed
                leftover.unlink()
            damaged = damage.of(path)
            if damaged:
                unfinished = _beside(path, "new")
                _template(config, predicted_std, augmented_std, unfinished)
                complain([damage.mend(path, unfinished, damaged)])
                shutil.rmtree(unfinished, ignore_errors=True)
            else:
                manifest.go_on(path, fingerprint(config))
            return zarr.open_group(path, mode="r+")
        if not config.campaign.replace:
            raise DataError(
                f"campaign.store = {path}: holds a campaign of another configuration or version; "
                "choose another path, delete it, or allow it with campaign.replace=true"
            )
    # hidden, for a campaign of the user's may be called anything; whole folders change names, so
    # a kill in between leaves either store or none, and no half of one
    unfinished, replaced = _beside(path, "new"), _beside(path, "old")
    try:
        shutil.rmtree(replaced, ignore_errors=True)
        _template(config, predicted_std, augmented_std, unfinished)
        if path.exists():
            path.rename(replaced)
        unfinished.rename(path)
        shutil.rmtree(replaced, ignore_errors=True)
    except OSError as error:
        raise DataError(f"campaign.store = {path}: cannot be written ({error.strerror})") from None
    return zarr.open_group(path, mode="r+")


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


def _template(
    config: Config, predicted_std: np.ndarray, augmented_std: np.ndarray, path: Path
) -> None:
    """Write a store without any runs, in place of an unfinished one."""
    import dask.array  # for a new store alone, like what compiles

    from inscal.convergence import REASONS, chance_limits
    from inscal.motion import update_count

    setup = Setup(config)
    updates = update_count(setup.schedule, config.estimator.update_interval_s)
    lower, upper = chance_limits(updates)
    runs = config.campaign.runs
    chunk = -(-runs // _CHUNKS)

    def lazy(dims, shape, fill, attrs):
        chunks = (chunk, *shape[1:])
        return dims, dask.array.full(shape, fill, chunks=chunks, dtype=type(fill)), attrs

    def whole(fill, attrs):  # in one file
        return ("run",), dask.array.full(runs, fill, chunks=runs, dtype=type(fill)), attrs

    per_parameter = {"units": "see coordinate unit"}
    further: dict[str, tuple] = {}
    coordinates: dict[str, Any] = {}
    if len(augmented_std):
        about = {"units": "see coordinate augmented_unit"}
        for name in _AUGMENTED:
            told = {"long_name": name.replace("_", " "), **about}
            further[name] = lazy(("run", "augmented"), (runs, len(augmented_std)), np.nan, told)
        told = {"long_name": "predicted standard deviation", **about}
        further["augmented_predicted_std"] = "augmented", augmented_std, told
        names, units = setup.augmented_names, setup.augmented_units
        coordinates["augmented"] = np.array(names, dtype=object)
        coordinates["augmented_unit"] = "augmented", np.array(units, dtype=object)
    both, table = ("run", "parameter"), (runs, COUNT)
    dataset = xr.Dataset(
        {
            "truth": lazy(both, table, np.nan, {"long_name": "true parameter", **per_parameter}),
            "estimate": lazy(both, table, np.nan, {"long_name": "estimate", **per_parameter}),
            "error": lazy(
                both, table, np.nan, {"long_name": "estimate minus truth", **per_parameter}
            ),
            "nees": lazy(
                ("run",),
                (runs,),
                np.nan,
                {"long_name": "normalised estimation error squared", "units": "1"},
            ),
            "status": lazy(
                ("run",),
                (runs,),
                np.int8(NOT_RUN),
                {"flag_values": [0, 1, 2], "flag_meanings": "not_run done failed"},
            ),
            "passes": whole(np.int8(0), {"long_name": "passes made", "units": "1"}),
            "reason": whole(
                np.int8(0),
                {
                    "flag_values": list(range(len(REASONS))),
                    "flag_meanings": " ".join(r.replace(" ", "_") or "none" for r in REASONS),
                },
            ),
            "innovation_ratio": whole(
                np.nan,
                {
                    "long_name": "squared innovations over their expectation",
                    "units": "1",
                    "chance_lower": lower,
                    "chance_upper": upper,
                },
            ),
            "predicted_std": (
                "parameter",
                predicted_std,
                {"long_name": "predicted standard deviation of the estimate", **per_parameter},
            ),
            **further,
        },
        coords={
            "run": np.arange(runs),
            "parameter": np.array(NAMES, dtype=object),
            "unit": ("parameter", np.array(UNITS, dtype=object)),
            **coordinates,
        },
        attrs={
            "title": f"inscal campaign {Path(config.campaign.store).name}",
            "fingerprint": fingerprint(config),
            "seed": config.campaign.seed,
            "configuration": resolved(config),
            "software": {name: version(name) for name in _SOFTWARE},
        },
    )
    dataset["run"].encoding["chunks"] = (runs,)
    for name in map(str, dataset.variables):
        dataset[name].encoding["compressors"] = (ZstdCodec(level=0), Crc32cCodec())
    dataset.to_zarr(path, mode="w", compute=False, consolidated=False, zarr_format=3)
    manifest.sign(path)
    manifest.seal(path, fingerprint(config))


def pending(store: zarr.Group) -> np.ndarray:
    """Numbers of the runs still to be made, ascending."""
    return np.flatnonzero(_array(store, "status")[:] == NOT_RUN)


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
    """
    from pipeline.campaign.worker import joined

    if not results:
        return
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
            for name, values in zip(_AUGMENTED, (truth, estimate, estimate - truth), strict=True):
                _array(store, name)[part] = values
        for name in ("nees", "passes", "reason", "innovation_ratio"):
            _array(store, name)[part] = getattr(outcome, name)
        if batch.exceptions:
            raised = {str(number): text for number, text in batch.exceptions.items()}
            every = {**store.attrs.get("exceptions", {}), **raised}  # type: ignore[dict-item]
            store.attrs["exceptions"] = {key: every[key] for key in sorted(every, key=int)}
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
    array = store[name]
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
    damage.refuse(place)
    try:
        # a run counts from the moment its status says so, so that is read before its numbers are
        status = np.asarray(_array(zarr.open_group(place, mode="r"), "status")[:])
        campaign = xr.load_dataset(place, engine="zarr", consolidated=False, chunks=None)
        campaign["status"][:] = status
        damage.refuse_nonsense(place, campaign)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise damage.error(place, [manifest.Damage("it", f"cannot be read ({error})")]) from None
    about = campaign.attrs["configuration"]
    about.setdefault("disturbance", dict(undisturbed()))
    about["estimator"].setdefault("believed", dict(usual_belief()))
    return campaign


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
