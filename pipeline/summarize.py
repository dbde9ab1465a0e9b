"""Stage `summarize`: a campaign's errors judged against the bounds and against the filter's sigma.

Usage: ``python -m pipeline.summarize [schedule=...] [noise=...] [campaign.store=...]``

For example::

    python -m pipeline.summarize schedule=position19 noise=quiet
    python -m pipeline.summarize campaign.store=results/runs/try bounds.gyro_bias_deg_per_h=0.002

Reads: schedule noise campaign.store campaign.max_failed_share bounds out.
"""

from pathlib import Path

import xarray as xr

from pipeline.campaign.judged import as_json, summary_of, table_text
from pipeline.campaign.store import refuse_failures
from pipeline.config.schema import Config
from pipeline.config.stage import stage
from pipeline.console.errors import ConfigError
from pipeline.console.output import json_data, write_text
from pipeline.console.terminal import new_table, say, show, show_augmented
from pipeline.study import findings
from pipeline.study.findings import SUMMARY_FOLDER
from pipeline.study.headline import headline
from pipeline.study.honesty import honesty, told
from pipeline.words.markdown import number


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
            number(float(row.rmse_over_predicted), 3),
            f"{float(row.abs_error_p95):.3g}",
            f"{float(row.bound):g}",
            f"{100 * float(row.share_within_bound):.1f} %",
            " - ".join(f"{100 * float(end):.1f}" for end in interval),
        )
    done, failed = int(summary.runs_done), int(summary.runs_failed)
    show(f"{summary.attrs['campaign']}, {done + failed} runs", table)
    data = json_data(as_json(summary))
    say(headline(data))
    say(
        f"NEES mean {number(float(summary.nees_mean))} of {done} runs that converged, "
        f"consistent if in {float(summary.nees_lower):.2f} ... {float(summary.nees_upper):.2f}"
    )
    for part in told(data).splitlines():
        if part != honesty(data):  # which the headline says
            say(part)
    say(
        f"every RMSE known to {100 * float(summary.precision):.1f} % or better, that of "
        f"{summary.least_precise.item()} worst"
    )
    for line in findings.run_lines(summary.attrs):
        say(line)
    if rows := summary.attrs.get("augmented"):
        keys = ("bias", "rmse", "predicted_std", "rmse_over_predicted")
        cells = [(k, r["unit"], *(f"{r[key]:.3g}" for key in keys)) for k, r in rows.items()]
        show_augmented(keys, cells)


def _default(config: Config, summary: xr.Dataset) -> Path:
    """Where the summary goes without `out`; ConfigError if another store's is there."""
    path = SUMMARY_FOLDER / f"{summary.attrs['campaign']}.json"
    if path.exists():
        other = findings.read_summary(path.stem).get("store", summary.attrs["store"])
        if other != summary.attrs["store"]:
            raise ConfigError(
                f"campaign.store = {config.campaign.store!r}: must be {other}, whose summary is in "
                f"{path}, or that is to be given with out=FILE.json"
            )
    return path


@stage(writes=(".json", ".csv"))
def main(config: Config) -> None:
    """Summarize one campaign into a table on the terminal, a CSV and a JSON file.

    Raises
    ------
    FailedRunsError
        If more of its runs failed than `campaign.max_failed_share` allows; the files are written.
    """
    summary = summary_of(config, config.campaign.store)
    print_summary(summary)
    file = Path(config.out) if config.out else _default(config, summary)
    write_text(file.with_suffix(".csv"), table_text(summary))
    write_text(file, as_json(summary))
    refuse_failures(config, int(summary.runs_done), int(summary.runs_failed))


if __name__ == "__main__":
    main()
