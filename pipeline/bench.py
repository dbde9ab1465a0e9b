"""Stage `bench`: what a calibrated run costs, in units of the random numbers it needs.

Usage: ``python -m pipeline.bench [out=FILE]``, on a machine that does nothing else.

F is the time to draw 342 000 standard normals once, as fast as is known here: SFC64, one by one in
a compiled loop. So many a 25-position calibration takes in steps of 1 s at rest and 0.01 s in
turns. R is the time of one complete run, simulation, all passes and NEES. Both are measured in turn
in one process, so their ratio holds where the machine's speed drifts.

For example::

    python -m pipeline.bench out=bench.json

Reads: out schedule noise truth estimator campaign.batch site simulation sensor.
"""

from pipeline.campaign.cost import cost, seconds_of, throughput
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.config.stage import stage
from pipeline.console.output import write_json


@stage(writes=(".json",))
def main(config: Config) -> None:
    """Measure, print, and write as JSON where `out` says."""
    experiment = Setup(config).experiment  # compiles or loads what is compiled
    seconds = seconds_of(lambda: Setup(config).experiment)
    figures = {"setup_ms": 1e3 * seconds} | cost(experiment) | throughput(config, experiment)
    for name, value in figures.items():
        print(f"{name:26} {value:10.3f}")
    if config.out:
        write_json(config.out, figures)


if __name__ == "__main__":
    main()
