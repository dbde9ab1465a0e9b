"""Stage `paper_laboratory`: the paper's laboratory experiment (Table 4, Figs. 5 to 8), simulated.

Usage: ``python -m pipeline.paper_laboratory estimator=laboratory``

Writes ``results/paper/laboratory.md``, ``.json`` and ``.png``, and its claims.

For example::

    python -m pipeline.paper_laboratory estimator=laboratory laboratory.runs=64

Reads: laboratory schedule noise disturbance estimator campaign.seed site simulation sensor bounds.
"""

from pipeline.paper import laboratory_report as report
from pipeline.paper.config import PaperConfig, stage
from pipeline.paper.laboratory_study import study_of
from pipeline.paper.pages import write_page


@stage
def main(config: PaperConfig) -> None:
    """Write the report, its numbers and its figure."""
    study = study_of(config)
    write_page(
        "laboratory",
        report.text(study),
        report.claims_of(study),
        report.numbers(study),
        report.figure(study),
    )


if __name__ == "__main__":
    main()
