"""Stage `compare`: which of two campaigns keeps all bounds more often, and their RMSE, paired.

Usage: ``python -m pipeline.compare a=STORE b=STORE [out=FILE.csv]``. Both campaigns must share the
seed and the truth; they may differ in anything else. The verdict is by the share of runs that keep
all bounds; a ratio of RMSE above one means that `a` is worse in that parameter.

For example::

    python -m pipeline.compare a=results/runs/one_pass b=results/runs/two_pass out=passes.csv

Reads: a b out bounds.
"""

from pathlib import Path

import xarray as xr

from pipeline.campaign.judged import as_json, bounds_of, comparison_of, table_text
from pipeline.config.schema import Config
from pipeline.config.stage import stage
from pipeline.console.errors import ConfigError
from pipeline.console.output import json_data, write_text
from pipeline.console.terminal import new_table, say, show
from pipeline.study.findings import contest, contest_verdict

_FOLDER = Path("results/comparison")


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


@stage(writes=(".csv", ".json", ".md"))
def main(config: Config) -> None:
    """Compare stores `a` and `b` into a table and a verdict, on the terminal and in files."""
    for key in ("a", "b"):
        if getattr(config, key) is None:
            raise ConfigError(f"{key} = null: must be the path of a campaign store")
    result = comparison_of(config.a or "", config.b or "", bounds_of(config))
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
