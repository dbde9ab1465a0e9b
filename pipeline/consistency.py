"""Stage `consistency`: is the filter as good as it says, and as any could be.

Usage: ``python -m pipeline.consistency [campaign.store=...]``

Judges a campaign, repeats a sample of its runs for their innovations, and writes tables, figures
and ``results/consistency.md``. All but the path is taken from the configuration that the campaign
was made with.

For example::

    python -m pipeline.consistency campaign.store=results/runs/position25-reference-consistency

Reads: campaign.store campaign.seed.
"""

from pathlib import Path

from pipeline.campaign.judged import as_json, table_text
from pipeline.charts import consistency as consistency_plots
from pipeline.charts import style
from pipeline.config.load import config_of
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.config.stage import stage
from pipeline.console.errors import DataError
from pipeline.console.output import json_data, write_text
from pipeline.console.progress import busy
from pipeline.proof import report as consistency_report
from pipeline.proof import statistics as numbers
from pipeline.proof.power import measured
from pipeline.proof.repeat import (
    FOLDER,
    REPORT,
    bounds_of,
    campaign_of,
    correlation_of,
    done_of,
    prior_differs,
    repeat_runs,
)


@stage
def main(config: Config) -> None:
    """Judge one campaign."""
    done = done_of(config.campaign.store)
    made_with = config_of(done.attrs["configuration"])
    experiment = Setup(made_with).experiment
    with busy("repeating runs for their innovations"):
        repeated = repeat_runs(done, made_with, experiment)
    positions = len(made_with.schedule.rotations) + 1
    if len(set(Setup(made_with).schedule.durations)) > 1:
        raise DataError(f"campaign.store = {config.campaign.store}: its positions differ in length")
    bounds = bounds_of(made_with, experiment)
    about = numbers.innovations(repeated, experiment, positions)
    correlation, last = correlation_of(experiment), numbers.last_pass(about)
    study = numbers.estimates(done, bounds).assign_attrs(
        campaign=Path(config.campaign.store).name,
        seed=made_with.campaign.seed,
        usual_seed=config.campaign.seed,
        noise=done.attrs["configuration"]["noise"],
        prior_differs=prior_differs(made_with, experiment),
        positions=positions,
        position_duration_s=made_with.schedule.position_duration_s,
        looks=numbers.looks_at(done, bounds, correlation, last),
        measured=measured(campaign_of(done, experiment)),
        innovations=about,
    )
    text = as_json(study)
    write_text(FOLDER / "consistency.csv", table_text(study))
    write_text(FOLDER / "consistency.json", text)
    style.save(consistency_plots.zip_plot(done, study), FOLDER / "zip.png")
    style.save(consistency_plots.innovations(repeated, study), FOLDER / "innovations.png")
    write_text(REPORT, consistency_report.report_text(json_data(text)))
    print(REPORT)


if __name__ == "__main__":
    main()
