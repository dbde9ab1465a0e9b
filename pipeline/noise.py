"""Stage `noise`: what noise a unit has, from a rest in its log.

Usage: ``python -m pipeline.noise log=HEADER.yaml [name=NAME] [out=FILE.json]``

Fits white noise, flicker, random walk and quantisation to the Allan deviations of the log's longest
rest, and prints them with intervals. With ``name`` they become ``conf/noise/NAME.yaml`` and
``conf/disturbance/NAME.yaml``, for campaigns; with ``out`` numbers, page and figure are written.

For example::

    python -m pipeline.noise log=mine.yaml name=mine
    python -m pipeline.noise log=mine.yaml out=results/logs/noise.json

Reads: noise log name out.
"""

from pathlib import Path

from inscal.units import DEG_PER_HOUR, MICRO_G
from pipeline.charts import style
from pipeline.charts.noise import allan
from pipeline.config.schema import Config
from pipeline.config.stage import stage
from pipeline.console.errors import ConfigError
from pipeline.console.output import write_found, write_text
from pipeline.console.terminal import show_rows
from pipeline.logs.resting import configuration, content, noise_of, page, rows

_UNITS = {"gyro": ("deg/h", DEG_PER_HOUR), "accel": ("ug", MICRO_G)}


@stage(writes=(".json", ".md", ".png"))
def main(config: Config) -> None:
    """Fit, print and write."""
    if config.log is None:
        raise ConfigError("log = null: must be the path of a log's header")
    found = noise_of(config)
    files = configuration(found, config)
    show_rows(found.log, ("sensor", "noise", "unit"), ("x", "y", "z"), rows(found, intervals=False))
    for path, text in files.items():
        write_text(path, text)
        print(path)
    if config.out:
        figure = Path(config.out).with_suffix(".png")
        style.save(allan(found.fits, _UNITS), figure)
        write_found(config.out, content(found), page(found, figure.name, files))


if __name__ == "__main__":
    main()
