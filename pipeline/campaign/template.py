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
        for name in AUGMENTED:
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
            **attributes(config),
        },
    )
    dataset["run"].encoding["chunks"] = (runs,)
    for name in map(str, dataset.variables):
        dataset[name].encoding["compressors"] = (ZstdCodec(level=0), Crc32cCodec())
    with warnings.catch_warnings():  # one file names all arrays, so that xarray opens it silently
        warnings.simplefilter("ignore", ZarrUserWarning)
        dataset.to_zarr(path, mode="w", compute=False, consolidated=True, zarr_format=3)
    manifest.sign(path)
    manifest.seal(path, fingerprint(config))
