"""Stage `budget`: what every error is made of, and how good a laboratory must be; no simulation.

Usage: ``python -m pipeline.budget [disturbance=...] [schedule=...] [noise=...] [out=FILE]``

Prints of every parameter the sigma that the filter claims, the true one with the disturbances that
it knows nothing of, and the largest sources; and of every disturbance alone the size at which sigma
is no longer to be believed. With `out` the variances by source are written as JSON, and beside it
under the same name a page (.md); its pictures: shares (.png), effects by parameter and source
(``_mosaic.png``), and one parameter over time (``_time.png``), the most disturbed one or that of
`parameter`; and tables: shares (.csv), ``_sensitivity.csv``, ``_tolerances.csv``, ``_traces.csv``.

For example::

    python -m pipeline.budget disturbance=laboratory
    python -m pipeline.budget disturbance.table_offset_mm=5 parameter=lever_arm_x out=budget.json

Reads: schedule noise disturbance truth estimator parameter out site simulation sensor bounds
campaign.seed.
"""

from pathlib import Path

import numpy as np

from inscal.parameters import NAMES, UNITS
from pipeline.charts import style
from pipeline.charts.budget import contributions, mosaic, over_time
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.config.stage import stage
from pipeline.console.output import write_json, write_text
from pipeline.console.terminal import new_table, show
from pipeline.study.budget import Sheet, checkpoints, sheet
from pipeline.study.budget_page import csv, page, sensitivities, shares, tolerances, traces

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


@stage(writes=(".json", ".md", ".png"))
def main(config: Config) -> None:
    """Print the budget and the tolerances; write all of it where `out` says."""
    found = sheet(Setup(config))
    _show_parameters(found)
    if found.size:
        _show_tolerances(found)
    if config.out:
        _write(config, found, Path(config.out))


def _write(config: Config, found: Sheet, path: Path) -> None:
    write_json(path, found.content())
    place = NAMES.index(config.parameter) if config.parameter else found.most_disturbed
    updates, known = checkpoints(config), list(found.budget.formal)
    times = np.array(updates) * config.estimator.update_interval_s
    tables = {"": shares, "_sensitivity": sensitivities, "_tolerances": tolerances}
    tables |= {"_traces": traces}
    figures = {
        "": contributions(found.variance, known),
        "_mosaic": mosaic(found.variance, found.formal_std, known),
        "_time": over_time(times, found.course(place, updates), known, place),
    }
    for ending, table in tables.items():
        write_text(path.with_name(f"{path.stem}{ending}.csv"), csv(table(found)))
    for ending, figure in figures.items():
        style.save(figure, path.with_name(f"{path.stem}{ending}.png"))
    write_text(path.with_suffix(".md"), page(config, found, path.stem, place))


if __name__ == "__main__":
    main()
