"""Stage `estimators`: filters with augmented states, what they stand and what they cost.

Usage: ``python -m pipeline.estimators disturbance=laboratory [campaign.runs=...] [out=FILE]``

Makes a campaign for each group of augmented states, with the disturbance that it is about in the
truth, and for the named filters with nothing disturbed, with what they model, and with all
disturbances of the configuration; stores are folders of `campaign.store`, and what is there already
is not made again. Writes results/estimators.md and .json, or FILE and its .md with ``out=FILE``.

For example::

    python -m pipeline.estimators disturbance=laboratory campaign.store=results/runs/mine
    python -m pipeline.estimators disturbance=laboratory campaign.runs=1000 out=filters.json

Reads: schedule noise disturbance truth cluster cluster.workers cluster.address campaign.runs
campaign.seed campaign.batch campaign.store campaign.replace campaign.max_failed_share out site
simulation sensor bounds.
"""

from pipeline.campaign.driver import simulate_campaign
from pipeline.config.schema import Config
from pipeline.config.stage import stage
from pipeline.console.output import write_found
from pipeline.study.estimators import content, page, plans

_FILE = "results/estimators.json"


@stage(writes=(".json", ".md"))
def main(config: Config) -> None:
    """Make the campaigns and judge them."""
    planned = plans(config)
    for plan in planned:
        simulate_campaign(plan.config)
    found = content(config, planned)
    write_found(config.out or _FILE, found, page(found))


if __name__ == "__main__":
    main()
