"""Stage `simulate`: a campaign of calibrated runs into a store, or one of its runs in full.

Usage: ``python -m pipeline.simulate [schedule=...] [noise=...] [truth=...] [campaign.runs=...]``,
``only_run=17`` to repeat run 17 alone and keep its course, ``campaign.precision=0.05`` to stop as
soon as every RMSE is known to five per cent (half of its 95 % interval).

For example::

    python -m pipeline.simulate schedule=position19 noise=quiet
    python -m pipeline.simulate campaign.precision=0.03 campaign.runs=20000 campaign.store=results/x
    python -m pipeline.simulate only_run=17    # this run again, with its course over time

Reads: schedule noise disturbance truth estimator cluster cluster.workers cluster.address
campaign.runs campaign.precision campaign.seed campaign.batch campaign.store campaign.replace
campaign.max_failed_share only_run out site simulation sensor.
"""

from pathlib import Path

from pipeline.campaign.course import history_dataset
from pipeline.campaign.driver import simulate_campaign
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.config.stage import stage
from pipeline.console.errors import ConfigError
from pipeline.console.output import complain, written


def repeat_run(config: Config) -> None:
    """Repeat one run of a campaign and write its course as netCDF.

    Raises
    ------
    DataError
        If the file cannot be written.
    """
    path = Path(config.out or f"{config.campaign.store}-run{config.only_run}.nc")
    course = history_dataset(config)
    with written(path) as file:
        course.to_netcdf(file, engine="scipy")
    print(f"run {config.only_run} of seed {config.campaign.seed}: course in {path}")


@stage(writes=(".nc",))
def main(config: Config) -> None:
    """Run the campaign, or the one run asked for."""
    complain(Setup(config).warnings)
    if config.only_run is None and config.out:
        raise ConfigError(f"out = {config.out!r}: must be null without only_run")
    if config.only_run is None:
        simulate_campaign(config)
    else:
        repeat_run(config)


if __name__ == "__main__":
    main()
