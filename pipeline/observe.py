"""Stage `observe`: what a schedule makes observable, by rank and by sigma.

Usage: ``python -m pipeline.observe [schedule=...] [noise=...] [out=FILE.csv]``. With `out` the
course of every parameter's sigma goes to a CSV file and, beside it, to a heat map.

For example::

    python -m pipeline.observe schedule=position19
    python -m pipeline.observe 'schedule.rotations=[[90,Y],[180,Y],[90,X]]' out=observe.csv

Reads: schedule noise estimator out sensor simulation site.
"""

from pathlib import Path

import numpy as np

from inscal.parameters import NAMES
from pipeline.charts import style
from pipeline.charts.observability import sigma_heat_map
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.config.stage import stage
from pipeline.console.output import complain, write_text
from pipeline.console.terminal import new_table, say, show, show_rows
from pipeline.study import unseen
from pipeline.study.observability import (
    CONVENTIONS,
    TIED,
    Observability,
    direction_text,
    observability_of,
    rank_counts,
    share_table,
    tied_text,
)

_FEW = 6  # positions whose sigmas fit a window


def print_ranks(config: Config) -> None:
    """Print the rank after every position by each of `CONVENTIONS`."""
    letters = "ABCDEFGH"[: len(CONVENTIONS)]
    table = new_table((), ("position", *letters))
    columns = [
        [counts.rank for counts in rank_counts(config, convention)]
        for convention in CONVENTIONS.values()
    ]
    for row in range(len(columns[0][0])):
        cells = [_both(by_default[row], unit_free[row]) for by_default, unit_free in columns]
        table.add_row(str(row + 1), *cells)
    show(f"rank of the stripped observability matrix: {config.schedule.name}", table)
    print("\n".join(f"{key}: {name}" for key, name in zip(letters, CONVENTIONS, strict=True)))


def _both(by_default: int, unit_free: int) -> str:
    return str(by_default) if by_default == unit_free else f"{by_default} ({unit_free} unit-free)"


def print_sigmas(config: Config, found: Observability) -> None:
    """Print how each sigma falls, the weakest combinations and the tied pairs."""
    count = len(found.share)
    chosen = sorted({round(n) for n in np.linspace(1, count, min(count, _FEW))})
    table = new_table(("parameter",), tuple(map(str, chosen)))
    for name, share in zip(NAMES, found.share.T, strict=True):
        table.add_row(name, *(f"{share[number - 1]:.2g}" for number in chosen))
    show(f"\nsigma over initial sigma after position ...: {config.schedule.name}", table)
    print("Least known combinations:")
    for direction in found.directions:
        say(f"  {direction_text(direction)}", indent="    ")
    print(f"Tied pairs, correlation of {TIED:g} or more:")
    for text in [*map(tied_text, found.tied)] or ["none"]:
        print(f"  {text}")


@stage(writes=(".csv", ".png"))
def main(config: Config) -> None:
    """Print ranks and sigmas of a path; write the sigmas where `out` says."""
    setup = Setup(config)
    complain(setup.warnings)
    print_ranks(config)
    found = observability_of(setup)
    print_sigmas(config, found)
    if rows := unseen.rows(setup):
        show_rows(unseen.TITLE, unseen.HEADINGS[:1], unseen.HEADINGS[1:], rows)
    if config.out:
        write_text(config.out, share_table(found))
        figure = sigma_heat_map(found.share, f"{config.schedule.name}, {config.noise.name} noise")
        style.save(figure, Path(config.out).with_suffix(".png"))


if __name__ == "__main__":
    main()
