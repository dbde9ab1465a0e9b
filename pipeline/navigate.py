"""Stage `navigate`: a log navigated freely, with and without compensation.

Usage: ``python -m pipeline.navigate log=HEADER.yaml compensation=FILE.yaml [out=FILE.json]``

The unit stays where it is, so all that navigation finds is error. Height is held, nothing is
observed; the compensation is what ``pipeline.calibrate`` wrote. With ``out`` the course, a page and
a figure are written.

For example::

    python -m pipeline.navigate log=mine.yaml compensation=found.yaml out=results/logs/flight.json

Reads: log compensation out.
"""

from pathlib import Path

from pipeline.charts import style
from pipeline.charts.flight import errors
from pipeline.config.schema import Config
from pipeline.config.stage import stage
from pipeline.console.errors import ConfigError
from pipeline.console.output import write_found
from pipeline.console.terminal import show_rows
from pipeline.logs.flight import LANES, content, flown, page, rows


@stage(writes=(".json", ".md", ".png"))
def main(config: Config) -> None:
    """Navigate, print and write."""
    for key in ("log", "compensation"):
        if getattr(config, key) is None:
            raise ConfigError(f"{key} = null: must be the path of a file")
    found = flown(config)
    show_rows(found.log, ("",), LANES, rows(found))
    if config.out:
        figure = Path(config.out).with_suffix(".png")
        style.save(errors(found.flight, LANES), figure)
        write_found(config.out, content(found), page(found, figure.name))


if __name__ == "__main__":
    main()
