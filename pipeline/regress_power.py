"""Stage `regress_power`: the gate measured. How often it cries wolf, and what loss it finds.

Usage: ``python -m pipeline.regress_power``, some eight minutes on one core. It writes ``power.md``
and ``power.json`` beside the baseline, and reads nothing of it.

The trials are of two sorts, and both are needed:

- *Simulated calibrations*: 500 campaigns of 128 runs each, disjoint, of a seed that is not the
  gate's. Two different ones are a baseline and its re-seeded repetition. There are few of them for
  a rate of one in a thousand: pairs drawn from them share campaigns, so they show that there is
  nothing the normal distribution does not know, and no more.
- *Normal errors* of the predicted covariance: as many campaigns as one likes.

Reads: schedule noise truth estimator campaign.seed site simulation sensor bounds.
"""

from pipeline.config.schema import Config
from pipeline.config.stage import stage
from pipeline.console.output import write_json, write_text
from pipeline.gate.judge import BASELINE
from pipeline.gate.power import report, study


@stage
def main(config: Config) -> None:
    """Measure the gate and write the tables."""
    config.campaign.seed += 1  # other runs than the gate's own
    result = study(config)
    write_json(BASELINE / "power.json", result)
    write_text(BASELINE / "power.md", report(result))


if __name__ == "__main__":
    main()
