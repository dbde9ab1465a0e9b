"""Stores without any runs: their arrays, and what they say of themselves.

Chunks are a property of the number of runs alone, few enough to keep a store small in files.
"""

import hashlib
import json
import warnings
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from zarr.codecs import Crc32cCodec, ZstdCodec
from zarr.errors import ZarrUserWarning

from inscal.parameters import COUNT, NAMES, UNITS
from pipeline.campaign import manifest
from pipeline.campaign.status import NOT_RUN
from pipeline.config.load import resolved, run_settings
from pipeline.config.schema import Config
from pipeline.config.setup import Setup

_CHUNKS = 12
_PARAMETER, _AUGMENTED = "see coordinate unit", "see coordinate augmented_unit"
AUGMENTED = ("augmented_truth", "augmented_estimate", "augmented_error")
"""Arrays of the augmented states that do not wander."""
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


def attributes(config: Config) -> dict[str, Any]:
    """What a dataset says of how it was made, in attributes that netCDF takes too.

    Parameters
    ----------
    config : Config

    Returns
    -------
    dict
        `configuration` and `software` are JSON; a `seed` that 32 bits do not hold is text.
    """
    seed = config.campaign.seed
    return {
        "seed": seed if seed < 2**31 else str(seed),
        "configuration": json.dumps(resolved(config)),
        "software": json.dumps({name: version(name) for name in _SOFTWARE}),
    }


def template(
    config: Config, predicted_std: np.ndarray, augmented_std: np.ndarray, path: Path
) -> None:
    """Write a store without any runs, in place of an unfinished one.

    Parameters
    ----------
    config : Config
    predicted_std : ndarray, shape (27,)
        In paper units.
    augmented_std : ndarray, shape (n,)
        Of the augmented states that do not wander, in the units of their keys.
    path : Path
    """
    dataset = xr.Dataset(
        {
            **_of_runs(config),
            "predicted_std": (
                "parameter",
                predicted_std,
                _told("predicted standard deviation of the estimate", _PARAMETER),
            ),
        },
        coords={
            "run": np.arange(config.campaign.runs),
            "parameter": np.array(NAMES, dtype=object),
            "unit": ("parameter", np.array(UNITS, dtype=object)),
        },
        attrs={
            "title": f"inscal campaign {Path(config.campaign.store).name}",
            "fingerprint": fingerprint(config),
            **attributes(config),
        },
    )
    if len(augmented_std):
        dataset = dataset.assign(_augmented(config, augmented_std))
        dataset = dataset.assign_coords(_augmented_coordinates(config))
    dataset["run"].encoding["chunks"] = (config.campaign.runs,)
    for name in map(str, dataset.variables):
        dataset[name].encoding["compressors"] = (ZstdCodec(level=0), Crc32cCodec())
    with warnings.catch_warnings():  # one file names all arrays, so that xarray opens it silently
        warnings.simplefilter("ignore", ZarrUserWarning)
        dataset.to_zarr(path, mode="w", compute=False, consolidated=True, zarr_format=3)
    manifest.sign(path)
    manifest.seal(path, fingerprint(config))


def _of_runs(config: Config) -> dict[str, tuple]:
    """Arrays that have a value, or one for each parameter, of every run."""
    from inscal.convergence import REASONS, chance_limits  # compiles, as above
    from inscal.motion import update_count

    runs = config.campaign.runs
    chunk = _chunk(runs)
    updates = update_count(Setup(config).schedule, config.estimator.update_interval_s)
    lower, upper = chance_limits(updates)
    status = {"flag_values": [0, 1, 2], "flag_meanings": "not_run done failed"}
    reason = {
        "flag_values": list(range(len(REASONS))),
        "flag_meanings": " ".join(r.replace(" ", "_") or "none" for r in REASONS),
    }
    ratio = _told("squared innovations over their expectation", "1")
    ratio |= {"chance_lower": lower, "chance_upper": upper}
    table = ("run", "parameter"), (runs, COUNT), chunk, np.nan
    each = ("run",), (runs,)
    return {
        "truth": _lazy(*table, _told("true parameter", _PARAMETER)),
        "estimate": _lazy(*table, _told("estimate", _PARAMETER)),
        "error": _lazy(*table, _told("estimate minus truth", _PARAMETER)),
        "nees": _lazy(*each, chunk, np.nan, _told("normalised estimation error squared", "1")),
        "status": _lazy(*each, chunk, np.int8(NOT_RUN), status),
        # in one file
        "passes": _lazy(*each, runs, np.int8(0), _told("passes made", "1")),
        "reason": _lazy(*each, runs, np.int8(0), reason),
        "innovation_ratio": _lazy(*each, runs, np.nan, ratio),
    }


def _augmented(config: Config, std: np.ndarray) -> dict[str, tuple]:
    """Arrays of the augmented states that do not wander."""
    runs = config.campaign.runs
    table = ("run", "augmented"), (runs, len(std)), _chunk(runs), np.nan
    told = _told("predicted standard deviation", _AUGMENTED)
    return {
        **{name: _lazy(*table, _told(name.replace("_", " "), _AUGMENTED)) for name in AUGMENTED},
        "augmented_predicted_std": ("augmented", std, told),
    }


def _augmented_coordinates(config: Config) -> dict[str, Any]:
    setup = Setup(config)
    return {
        "augmented": np.array(setup.augmented_names, dtype=object),
        "augmented_unit": ("augmented", np.array(setup.augmented_units, dtype=object)),
    }


def _chunk(runs: int) -> int:
    return -(-runs // _CHUNKS)


def _told(long_name: str, units: str) -> dict[str, Any]:
    return {"long_name": long_name, "units": units}


def _lazy(
    dims: tuple[str, ...], shape: tuple[int, ...], chunk: int, fill: Any, attrs: dict[str, Any]
) -> tuple:
    """An array of one value that is not held in memory, with so many runs to a file."""
    import dask.array  # for a new store alone, like what compiles

    chunks = (chunk, *shape[1:])
    return dims, dask.array.full(shape, fill, chunks=chunks, dtype=type(fill)), attrs
