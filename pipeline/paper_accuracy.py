"""Stage `paper_accuracy`: the paper's Table 3 beside a campaign, and the noise its bounds can bear.

Usage: ``python -m pipeline.paper_accuracy truth=paper campaign.store=STORE``

Writes ``results/paper/accuracy.md``, ``.json`` and ``.png``, and its claims. The campaign must have
the paper's truth; the sweeps of noise start from the configured one.

For example::

    python -m pipeline.paper_accuracy truth=paper campaign.store=results/runs/my-paper_truth

Reads: truth schedule noise disturbance estimator campaign.runs campaign.seed campaign.store site
simulation sensor bounds.
"""

from pipeline.config.schema import Config
from pipeline.config.stage import stage
from pipeline.paper import accuracy_report as report
from pipeline.paper.accuracy_study import study_of
from pipeline.paper.pages import write_page


@stage
def main(config: Config) -> None:
    """Write the report, its numbers and its figure."""
    study = study_of(config)
    write_page(
        "accuracy",
        report.text(study),
        report.claims_of(study),
        report.numbers(study),
        report.figure(study),
    )


if __name__ == "__main__":
    main()
