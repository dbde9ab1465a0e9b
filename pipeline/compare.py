"""Stage `compare`: RMSE of one campaign over another's, paired run by run.

Usage: ``python -m pipeline.compare a=STORE b=STORE [out=FILE.csv]``. Both campaigns must share the
seed and the truth; they may differ in anything else. A ratio above one means that `a` is worse.

For example::

    python -m pipeline.compare a=results/runs/one_pass b=results/runs/two_pass out=passes.csv

Reads: a b out.
"""

from pathlib import Path

import xarray as xr

from inscal.summary import compare
from pipeline import store
from pipeline.baseline import differences
from pipeline.config import Config, ConfigError, DataError, stage
from pipeline.findings import contest, contest_verdict
from pipeline.output import json_data, table_text, write_text
from pipeline.summarize import as_json
from pipeline.terminal import new_table, say, show

_FOLDER = Path("results/comparison")
_RESAMPLES = 4000


def comparison_of(a: str | Path, b: str | Path) -> xr.Dataset:
    """Paired comparison of two campaign stores.

    Parameters
    ----------
    a, b : str or Path

    Returns
    -------
    xarray.Dataset
        Of `inscal.summary.compare`.

    Raises
    ------
    DataError
        If a store is missing, or the two cannot be paired.
    """
    left, right = store.read(a), store.read(b)
    if left.attrs["seed"] != right.attrs["seed"]:
        seeds = left.attrs["seed"], right.attrs["seed"]
        raise DataError(f"a = {a}, b = {b}: seeds {seeds} differ, so their runs are no pairs")
    units = [campaign.attrs["configuration"]["sensor"] for campaign in (left, right)]
    if differing := differences(units[0], units[1], "sensor."):
        raise DataError(f"a = {a}, b = {b}: errors in other units: {', '.join(differing)}")
    try:
        result = compare(left, right, resamples=_RESAMPLES, seed=left.attrs["seed"])
    except ValueError as error:
        raise DataError(f"a = {a}, b = {b}: {error}") from None
    duration = [_duration(campaign) for campaign in (left, right)]
    return result.assign_attrs(a=Path(a).name, b=Path(b).name, duration_s=duration)


def _duration(campaign: xr.Dataset) -> float:
    schedule = campaign.attrs["configuration"]["schedule"]
    return (len(schedule["rotations"]) + 1) * schedule["position_duration_s"]


def print_comparison(result: xr.Dataset) -> None:
    """Print a comparison as a table."""
    a, b = result.attrs["a"], result.attrs["b"]
    table = new_table(("parameter",), ("ratio", "95 %", "95 % for all at once", "predicted"))
    for name in result.parameter.values:
        row = result.sel(parameter=name)
        table.add_row(
            str(name),
            f"{float(row.ratio):.3f}",
            f"{float(row.lower):.3f} - {float(row.upper):.3f}",
            f"{float(row.simultaneous_lower):.3f} - {float(row.simultaneous_upper):.3f}",
            f"{float(row.predicted_ratio):.3f}",
        )
    title = f"RMSE of a over RMSE of b, {int(result.runs_paired)} paired runs\na = {a}\nb = {b}"
    show(title, table)


@stage
def main(config: Config) -> None:
    """Compare stores `a` and `b` into a table and a verdict, on the terminal and in files."""
    for key in ("a", "b"):
        if getattr(config, key) is None:
            raise ConfigError(f"{key} = null: must be the path of a campaign store")
    if config.out and Path(config.out).suffix == ".json":
        raise ConfigError(f"out = {config.out!r}: must be a CSV file; the JSON file goes beside it")
    result = comparison_of(config.a or "", config.b or "")
    print_comparison(result)
    content = as_json(result)
    verdict = contest_verdict(contest(json_data(content)))
    say(verdict)
    default = _FOLDER / f"{result.attrs['a']}-over-{result.attrs['b']}.csv"
    path = Path(config.out) if config.out else default
    write_text(path, table_text(result))
    write_text(path.with_suffix(".json"), content)
    write_text(path.with_suffix(".md"), f"{verdict}\n")


if __name__ == "__main__":
    main()
