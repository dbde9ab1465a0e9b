"""Stage `export`: simulated runs as logs, for any calibrator.

Usage: ``python -m pipeline.export only_run=17 log=FILE.parquet [rate_hz=100]``

Writes the increments of a run, sample by sample, as Parquet or CSV, and their header beside it;
``runs=0:128`` writes many, with their numbers in the names. Needs 2 GB for 25 positions at 100 Hz.

For example::

    python -m pipeline.export only_run=17 log=logs/seventeen.parquet
    python -m pipeline.export runs=0:128 rate_hz=50 disturbance=laboratory log=logs/unit.parquet

Reads: schedule noise disturbance truth estimator campaign.runs campaign.seed only_run runs rate_hz
log site sensor.
"""

from pipeline.config.schema import Config
from pipeline.config.stage import stage
from pipeline.logs.exported import write


@stage
def main(config: Config) -> None:
    """Write the logs and print their headers."""
    print(*write(config), sep="\n")


if __name__ == "__main__":
    main()
