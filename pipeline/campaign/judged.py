"""A campaign judged against its bounds, and two campaigns against each other."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from inscal.parameters import NAMES
from inscal.summary import augmented, compare, summarize
from pipeline.campaign import store
from pipeline.config.load import differences, disturbances, position_durations
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.console.errors import DataError
from pipeline.console.output import complain, json_text, signed


def summary_of(config: Config, path: str | Path) -> xr.Dataset:
    """Summary of a campaign store.

    Parameters
    ----------
    config : Config
        Gives the bounds.
    path : str or Path
        Campaign store.

    Returns
    -------
    xarray.Dataset
        Of `inscal.summary.summarize`.

    Raises
    ------
    DataError
        If there is no store, or no run in it is done.
    """
    return summary(config, path, store.read(path))


def summary(config: Config, path: str | Path, campaign: xr.Dataset) -> xr.Dataset:
    """Summary of a campaign that has been read already; else as `summary_of`."""
    try:
        found = summarize(campaign, bounds_of(config))
    except ValueError as error:
        raise DataError(f"campaign store {path}: {error}") from None
    missing = campaign.sizes["run"] - int(found.runs_done) - int(found.runs_failed)
    if missing:
        complain([f"note: {path}: {missing} of {campaign.sizes['run']} runs are not made"])
    configuration = campaign.attrs["configuration"]
    return found.assign_attrs(
        campaign=Path(path).name,
        store=_shown(path),
        joint_share_asked=config.bounds.joint_share,
        each_share_asked=config.bounds.each_share,
        seed=campaign.attrs["seed"],
        passes=configuration["estimator"]["passes"],
        truth=configuration["truth"]["distribution"],
        schedule=configuration["schedule"]["name"],
        noise=configuration["noise"],
        quadratic_unit=configuration["sensor"]["quadratic_unit"],
        failed_runs=[int(r) for r in campaign.run[campaign.status == store.FAILED]],
        **_disturbed(configuration),
        **_augmented(campaign),
        **_verdicts(campaign),
    )


def _shown(path: str | Path) -> str:
    """Path of a store from here, if it is below, for others to find it."""
    whole, here = Path(path).resolve(), Path.cwd().resolve()
    return (whole.relative_to(here) if whole.is_relative_to(here) else whole).as_posix()


def bounds_of(config: Config) -> xr.DataArray:
    """Bounds of a configuration, on parameter, in paper units."""
    return xr.DataArray(Setup(config).bound, dims="parameter", coords={"parameter": list(NAMES)})


def _disturbed(configuration: Mapping[str, Any]) -> dict[str, Any]:
    """What truth held beyond the filter's belief; nothing of a campaign where it held no more."""
    present = disturbances(configuration)
    name = configuration["disturbance"]["name"]
    return {"disturbance": name, "disturbances": present} if present else {}


def _augmented(campaign: xr.Dataset) -> dict[str, Any]:
    """Statistics of augmented states, by name; nothing of a campaign that has none."""
    found = augmented(campaign)
    if found is None:
        return {}
    keys = ("bias", "rmse", "rmse_lower", "rmse_upper", "predicted_std", "rmse_over_predicted")
    rows = {
        str(name): {"unit": str(unit)} | {key: float(found[key][place]) for key in keys}
        for place, (name, unit) in enumerate(
            zip(found["parameter"].values, found["unit"].values, strict=True)
        )
    }
    return {"augmented": rows}


def _verdicts(campaign: xr.Dataset) -> dict[str, Any]:
    """What was found of the runs by their own data; nothing of a store that does not have it."""
    if not {"passes", "reason", "innovation_ratio"} <= set(campaign.data_vars):
        return {}
    done, failed = store.done(campaign), campaign.isel(run=campaign.status == store.FAILED)
    taken, counts = np.unique(done.passes, return_counts=True)
    meanings, raised = campaign.reason.flag_meanings.split(), campaign.attrs.get("exceptions", {})
    ratio = done.innovation_ratio
    beyond = (ratio < ratio.chance_lower) | (ratio > ratio.chance_upper)
    return {
        "passes_taken": {str(p): int(n) for p, n in zip(taken, counts, strict=True)},
        "failures": {
            str(run): raised.get(str(run), meanings[reason].replace("_", " "))
            for run, reason in zip(failed.run.values, failed.reason.values, strict=True)
        },
        "runs_contradicted": int(beyond.sum()),
    }


def as_json(dataset: xr.Dataset) -> str:
    """JSON text of a dataset on parameter: attributes, scalars, then one object per parameter.

    `pipeline.console.output.json_data` reads it back; NaN is null in between. It is signed.
    """
    scalars = {name: v.item() for name, v in dataset.data_vars.items() if v.ndim == 0}
    columns = {name: v.to_numpy().tolist() for name, v in dataset.data_vars.items() if v.ndim}
    columns["unit"] = [str(unit) for unit in dataset["unit"].to_numpy()]
    table = {
        str(name): {key: values[place] for key, values in columns.items()}
        for place, name in enumerate(dataset["parameter"].to_numpy())
    }
    return json_text(signed(dataset.attrs | scalars | {"parameters": table}))


_RESAMPLES = 4000


def comparison_of(a: str | Path, b: str | Path, bound: xr.DataArray | None = None) -> xr.Dataset:
    """Paired comparison of two campaign stores.

    Parameters
    ----------
    a, b : str or Path
    bound : xarray.DataArray, optional
        Of `bounds_of`; without, shares within bounds are not compared.

    Returns
    -------
    xarray.Dataset
        Of `inscal.summary.compare`.

    Raises
    ------
    DataError
        If a store is missing, or the two cannot be paired.
    """
    return comparison(a, store.read(a), b, store.read(b), bound)


def comparison(
    a: str | Path,
    left: xr.Dataset,
    b: str | Path,
    right: xr.Dataset,
    bound: xr.DataArray | None = None,
) -> xr.Dataset:
    """Paired comparison of two campaigns that have been read already; else as `comparison_of`."""
    if left.attrs["seed"] != right.attrs["seed"]:
        seeds = left.attrs["seed"], right.attrs["seed"]
        raise DataError(f"a = {a}, b = {b}: seeds {seeds} differ, so their runs are no pairs")
    units = [campaign.attrs["configuration"]["sensor"] for campaign in (left, right)]
    if differing := differences(units[0], units[1], "sensor."):
        raise DataError(f"a = {a}, b = {b}: errors in other units: {', '.join(differing)}")
    try:
        result = compare(left, right, resamples=_RESAMPLES, seed=left.attrs["seed"], bound=bound)
    except ValueError as error:
        raise DataError(f"a = {a}, b = {b}: {error}") from None
    complain(_unpaired(a, left, right))
    complain(_unpaired(b, right, left))
    duration = [_duration(campaign) for campaign in (left, right)]
    return result.assign_attrs(a=Path(a).name, b=Path(b).name, duration_s=duration)


def _unpaired(path: str | Path, campaign: xr.Dataset, other: xr.Dataset) -> list[str]:
    """Say how many runs of the other campaign a campaign does not have."""
    own, others = (
        set(one["run"].to_numpy()[(one["status"] != store.NOT_RUN).to_numpy()].tolist())
        for one in (campaign, other)
    )
    missing = len(others - own)
    return [f"note: {path}: {missing} runs of the other are not made here"] if missing else []


def _duration(campaign: xr.Dataset) -> float:
    return sum(position_durations(campaign.attrs["configuration"]["schedule"]))


def table_text(dataset: xr.Dataset) -> str:
    """CSV text of the per-parameter variables of a dataset, six significant digits."""
    table = dataset[[name for name, variable in dataset.data_vars.items() if variable.ndim == 1]]
    frame = table.to_dataframe().reset_index()
    leading = ["parameter", "unit"]
    frame = frame[leading + [name for name in frame.columns if name not in leading]]
    return frame.to_csv(index=False, float_format="%.6g")
