"""Stage `budget`: what every error is made of, and how good a laboratory must be; no simulation.

Usage: ``python -m pipeline.budget [disturbance=...] [schedule=...] [noise=...] [out=FILE]``

Prints of every parameter the sigma that the filter claims, the true one with the disturbances that
it knows nothing of, and the largest sources; and of every disturbance alone the size at which sigma
is no longer to be believed. With `out` the variances by source are written as JSON, and beside it
under the same name a page (.md), its picture (.png) and tables: shares (.csv), ``_sensitivity.csv``
and ``_tolerances.csv``.

For example::

    python -m pipeline.budget disturbance=laboratory
    python -m pipeline.budget disturbance.table_offset_mm=5 schedule=position19 out=budget.json

Reads: schedule noise disturbance truth estimator out site simulation sensor bounds campaign.seed.
"""

from pathlib import Path

from inscal.parameters import NAMES, UNITS
from pipeline.charts import style
from pipeline.charts.budget import contributions
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.config.stage import stage
from pipeline.console.errors import ConfigError
from pipeline.console.output import write_json, write_text
from pipeline.console.terminal import new_table, show
from pipeline.study.budget import Sheet, sheet
from pipeline.study.budget_page import csv, page, sensitivities, shares, tolerances

_SHOWN = 2


def _show_parameters(found: Sheet) -> None:
    table = new_table(("parameter", "unit"), ("formal", "true", "ratio", "largest sources"))
    for i, (name, unit) in enumerate(zip(NAMES, UNITS, strict=True)):
        formal, true = found.formal_std[i], found.true_std[i]
        if not formal > 0.0:
            table.add_row(name, unit, "not modelled", "", "", "")
            continue
        said = ", ".join(f"{s} {100 * share:.0f} %" for s, share in found.largest(i, _SHOWN))
        table.add_row(name, unit, f"{formal:.3g}", f"{true:.3g}", f"{true / formal:.2f}", said)
    show("what every error is made of", table)
    print(f"expected NEES: {found.budget.expected_nees:.1f}")


def _show_tolerances(found: Sheet) -> None:
    headings = "here", "sigma to", "by", "bounds to"
    table = new_table(("disturbance",), headings)
    for _, row in tolerances(found).iterrows():
        sigma, bounds = f"{row['sigma']:.2g}", f"{row['bounds']:.2g}"
        table.add_row(row["key"], f"{row['size']:g}", sigma, row["sigma_by"], bounds)
    show("each alone: the largest size at which the filter can be believed", table)


@stage
def main(config: Config) -> None:
    """Print the budget and the tolerances; write all of it where `out` says."""
    if config.out and Path(config.out).suffix != ".json":
        raise ConfigError(f"out = {config.out!r}: must be a JSON file; the page goes beside it")
    found = sheet(Setup(config))
    _show_parameters(found)
    if found.size:
        _show_tolerances(found)
    if config.out:
        _write(config, found, Path(config.out))


def _write(config: Config, found: Sheet, path: Path) -> None:
    write_json(path, found.content())
    tables = {"": shares, "_sensitivity": sensitivities, "_tolerances": tolerances}
    for ending, table in tables.items():
        write_text(path.with_name(f"{path.stem}{ending}.csv"), csv(table(found)))
    style.save(contributions(found.variance, list(found.budget.formal)), path.with_suffix(".png"))
    write_text(path.with_suffix(".md"), page(config, found, path.stem))


if __name__ == "__main__":
    main()
