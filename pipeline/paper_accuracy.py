"""Stage `paper_accuracy`: the paper's Table 3 beside a campaign, and the noise its bounds can bear.

Usage: ``python -m pipeline.paper_accuracy truth=paper campaign.store=STORE``

Writes ``results/paper/accuracy.md``, ``.json`` and ``.png``. The campaign must have the paper's
truth; the sweeps of noise start from the configured one.
"""

from pathlib import Path

from pipeline import figure_style as style
from pipeline import paper_accuracy_report as report
from pipeline.config import Config, stage
from pipeline.output import write_text
from pipeline.paper_accuracy_study import study_of

FOLDER = Path("results/paper")


@stage
def main(config: Config) -> None:
    """Write the report, its numbers and its figure."""
    study = study_of(config)
    write_text(FOLDER / "accuracy.json", report.numbers(study))
    write_text(FOLDER / "accuracy.md", report.text(study))
    style.save(report.figure(study), FOLDER / "accuracy.png")
    print(FOLDER / "accuracy.md")


if __name__ == "__main__":
    main()
