"""Stage `consistency_power`: how often a perfect filter misses goals of `consistency`, and others.

Usage: ``python -m pipeline.consistency_power [campaign.store=...]``, half a minute on one core

Draws campaigns as large as one that is judged, of a perfect filter and of filters whose claimed
sigmas are too small, and counts those that miss a goal. It writes results/consistency/power.json,
which `consistency` then quotes.

For example::

    python -m pipeline.consistency_power campaign.store=results/runs/mine

Reads: campaign.store campaign.seed.
"""

from pipeline.config.load import config_of
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.config.stage import stage
from pipeline.console.output import write_json
from pipeline.proof.power import PATH, measure
from pipeline.proof.repeat import campaign_of, done_of


@stage
def main(config: Config) -> None:
    """Measure, and write what was found."""
    done = done_of(config.campaign.store)
    experiment = Setup(config_of(done.attrs["configuration"])).experiment
    write_json(PATH, measure(campaign_of(done, experiment), config.campaign.seed))
    print(PATH)


if __name__ == "__main__":
    main()
