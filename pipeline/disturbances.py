"""Stage `disturbances`: a campaign with each disturbance alone, held against the error budget.

Usage: ``python -m pipeline.disturbances disturbance=laboratory [growth=1.5] [campaign.runs=...]``

Makes one campaign without disturbances, one with each that the configuration has, alone and at its
size there, and one with all; stores are folders of `campaign.store`, and what is there already is
not made again. All share their random draws. With `growth` each has the size at which the budget
lets the RMSE of one parameter grow by that factor. Writes results/disturbances.md and .json, or
FILE and its .md with ``out=FILE``.

For example::

    python -m pipeline.disturbances disturbance=laboratory campaign.store=results/runs/mine
    python -m pipeline.disturbances disturbance=laboratory growth=1.5 campaign.runs=2000 out=x.json

Reads: schedule noise disturbance truth estimator cluster cluster.workers cluster.address
campaign.runs campaign.seed campaign.batch campaign.store campaign.replace campaign.max_failed_share
growth out site simulation sensor bounds.
"""

from pipeline.campaign.driver import simulate_campaign
from pipeline.config.schema import Config
from pipeline.config.stage import stage
from pipeline.console.output import signed, write_found
from pipeline.study.disturbances import content, page, plans

_FILE = "results/disturbances.json"


@stage(writes=(".json", ".md"))
def main(config: Config) -> None:
    """Make the campaigns and judge them."""
    planned = plans(config)
    for plan in planned:
        simulate_campaign(plan.config)
    found = content(config, planned)
    write_found(config.out or _FILE, signed(found), page(found))


if __name__ == "__main__":
    main()
