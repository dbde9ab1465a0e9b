"""Stage `summarize`: a campaign's errors judged against the bounds and against the filter's sigma.

Usage: ``python -m pipeline.summarize [schedule=...] [noise=...] [campaign.store=...]``
"""

import json
from pathlib import Path

import xarray as xr
from rich.console import Console
from rich.table import Table

from inscal.parameters import NAMES
from inscal.summary import summarize
from pipeline import store
from pipeline.build import parameter_vector
from pipeline.config import Config, DataError, stage
from pipeline.output import complain, table_text, write_text

_FOLDER = Path("results/summary")


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
    campaign = store.read(path)
    bound = xr.DataArray(
        parameter_vector(config.bounds), dims="parameter", coords={"parameter": list(NAMES)}
    )
    try:
        summary = summarize(campaign, bound)
    except ValueError as error:
        raise DataError(f"campaign store {path}: {error}") from None
    missing = campaign.sizes["run"] - int(summary.runs_done) - int(summary.runs_failed)
    if missing:
        complain([f"note: {path}: {missing} of {campaign.sizes['run']} runs are not made"])
    configuration = campaign.attrs["configuration"]
    return summary.assign_attrs(
        campaign=Path(path).name,
        seed=campaign.attrs["seed"],
        passes=configuration["estimator"]["passes"],
        truth=configuration["truth"]["distribution"],
        schedule=configuration["schedule"]["name"],
        noise=configuration["noise"],
        quadratic_unit=configuration["sensor"]["quadratic_unit"],
        failed_runs=[int(r) for r in campaign.run[campaign.status == store.FAILED]],
    )


def print_summary(summary: xr.Dataset) -> None:
    """Print a summary as a table."""
    table = Table(title=f"{summary.attrs['campaign']}, {int(summary.runs_done)} runs")
    columns = ("parameter", "unit", "bias", "std", "RMSE", "95 %", "99.7 %", "predicted", "ratio")
    for heading in (*columns, "bound", "within", "interval"):
        table.add_column(heading, justify="left" if heading in ("parameter", "unit") else "right")
    for name in summary.parameter.values:
        row = summary.sel(parameter=name)
        numbers = (row[key] for key in ("bias", "std", "rmse", "abs_error_p95", "abs_error_p997"))
        interval = (row.share_within_bound_lower, row.share_within_bound_upper)
        table.add_row(
            str(name),
            str(row.unit.values),
            *(f"{float(number):.3g}" for number in numbers),
            f"{float(row.predicted_std):.3g}",
            f"{float(row.rmse_over_predicted):.3f}",
            f"{float(row.bound):g}",
            f"{100 * float(row.share_within_bound):.1f} %",
            " - ".join(f"{100 * float(end):.1f}" for end in interval),
        )
    console = Console(width=140)
    console.print(table)
    console.print(
        f"all within bounds at once: {100 * float(summary.joint_share):.1f} % "
        f"({100 * float(summary.joint_share_lower):.1f} - "
        f"{100 * float(summary.joint_share_upper):.1f} %)\n"
        f"NEES mean {float(summary.nees_mean):.2f}, consistent if in "
        f"{float(summary.nees_lower):.2f} ... {float(summary.nees_upper):.2f}\n"
        f"runs failed {int(summary.runs_failed)}; RMSE known to "
        f"{100 * float(summary.precision):.1f} %",
        highlight=False,
    )


def as_json(dataset: xr.Dataset) -> str:
    """JSON text of a dataset on parameter: attributes, scalars, then one object per parameter."""
    scalars = {name: v.item() for name, v in dataset.data_vars.items() if v.ndim == 0}
    table = {
        str(name): {
            key: v.sel(parameter=name).item() for key, v in dataset.data_vars.items() if v.ndim
        }
        | {"unit": str(dataset.unit.sel(parameter=name).values)}
        for name in dataset.parameter.values
    }
    return json.dumps(dataset.attrs | scalars | {"parameters": table}, indent=1) + "\n"


@stage
def main(config: Config) -> None:
    """Summarize one campaign into a table on the terminal, a CSV and a JSON file."""
    summary = summary_of(config, config.campaign.store)
    print_summary(summary)
    base = _FOLDER / summary.attrs["campaign"]
    write_text(f"{base}.csv", table_text(summary))
    write_text(f"{base}.json", as_json(summary))


if __name__ == "__main__":
    main()
