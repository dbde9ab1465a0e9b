"""Stage `calibrate`: estimates of a real unit's errors from the log of its calibration.

Usage: ``python -m pipeline.calibrate log=HEADER.yaml [estimator=...] [noise=...] [out=FILE.json]``

The header says what the columns of a log are; rests and turns are found in the data, no schedule is
needed. Prints the estimates with their sigmas and what the log does not give; with ``out`` writes
them to FILE, with a page and a compensation file beside it.

For example::

    python -m pipeline.calibrate log=mine.yaml estimator=states43 noise=quiet
    python -m pipeline.calibrate log=mine.yaml calibration.frame=accelerometer out=mine.json

Reads: noise estimator sensor calibration log out.
"""

from pathlib import Path

from pipeline.charts import style
from pipeline.charts.log import residuals
from pipeline.config.schema import Config
from pipeline.config.stage import stage
from pipeline.console.errors import ConfigError
from pipeline.console.output import write_found, write_text
from pipeline.console.terminal import show_rows
from pipeline.logs.calibration import calibrated, read_log
from pipeline.logs.evidence import evidence
from pipeline.logs.result import compensation, content, page, rows, said

_SHOWN = 5


@stage(writes=(".json", ".md", ".yaml"))
def main(config: Config) -> None:
    """Calibrate, print and write."""
    if config.log is None:
        raise ConfigError("log = null: must be the path of a log's header")
    if config.out and Path(config.out).with_suffix(".yaml").resolve() == Path(config.log).resolve():
        raise ConfigError(f"out = {config.out!r}: the compensation file would replace the header")
    found = calibrated(read_log(config), config)
    tests = evidence(found, config)
    headings = ("parameter", "unit"), ("estimate", "sigma")
    show_rows(f"{found.log.name}, axes: {config.calibration.frame}", *headings, rows(found))
    about = content(found, tests, config)
    print(f"rests: {about['dwells']}, passes: {about['passes']}")
    print(f"innovations squared over expected: {about['innovation_ratio']:.3g}")
    print(f"tests that speak against it: {len(tests.found)} of {len(tests.tests)}")
    for one in tests.found[:_SHOWN]:
        print("  {}: {}, chi-square {}, p {}".format(*said(one)))
    if config.out:
        place = Path(config.out)
        style.save(residuals(found, tests, config.calibration.left_out), place.with_suffix(".png"))
        write_text(place.with_suffix(".yaml"), compensation(found))
        written = page(found, tests, config, place.with_suffix(".png").name)
        write_found(config.out, about, written)


if __name__ == "__main__":
    main()
