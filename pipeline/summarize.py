"""Stage `summarize`: a campaign's errors judged against the bounds and against the filter's sigma.

Usage: ``python -m pipeline.summarize [schedule=...] [noise=...] [campaign.store=...]``

For example::

    python -m pipeline.summarize schedule=position19 noise=quiet
    python -m pipeline.summarize campaign.store=results/runs/try bounds.gyro_bias_deg_per_h=0.002

Reads: schedule noise campaign.store bounds.
"""

import xarray as xr

from pipeline.campaign.judged import _FOLDER, as_json, summary_of, table_text
from pipeline.config.schema import Config
from pipeline.config.stage import stage
from pipeline.console.output import write_text
from pipeline.console.terminal import new_table, show


def print_summary(summary: xr.Dataset) -> None:
    """Print a summary as a table."""
    table = new_table(
        ("parameter", "unit"),
        ("bias", "RMSE", "predicted", "ratio", "95 %", "bound", "within", "interval"),
        gap=1,
    )
    for name in summary.parameter.values:
        row = summary.sel(parameter=name)
        interval = (row.share_within_bound_lower, row.share_within_bound_upper)
        table.add_row(
            str(name),
            str(row.unit.values),
            *(f"{float(row[key]):.3g}" for key in ("bias", "rmse", "predicted_std")),
            _ratio(float(row.rmse_over_predicted)),
            f"{float(row.abs_error_p95):.3g}",
            f"{float(row.bound):g}",
            f"{100 * float(row.share_within_bound):.1f} %",
            " - ".join(f"{100 * float(end):.1f}" for end in interval),
        )
    show(f"{summary.attrs['campaign']}, {int(summary.runs_done)} runs", table)
    print(
        f"all within bounds at once: {100 * float(summary.joint_share):.1f} % "
        f"({100 * float(summary.joint_share_lower):.1f} - "
        f"{100 * float(summary.joint_share_upper):.1f} %)\n"
        f"NEES mean {float(summary.nees_mean):.2f}, consistent if in "
        f"{float(summary.nees_lower):.2f} ... {float(summary.nees_upper):.2f}\n"
        f"runs failed {int(summary.runs_failed)}; RMSE known to "
        f"{100 * float(summary.precision):.1f} %"
    )


def _ratio(value: float) -> str:
    return f"{value:.3f}" if value < 100.0 else f"{value:.3g}"


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
