"""Stage `paper_laboratory`: the paper's laboratory experiment (Table 4, Figs. 5 to 8), simulated.

Usage: ``python -m pipeline.paper_laboratory estimator=laboratory``

Writes ``results/paper/laboratory.md``, ``.json`` and ``.png``.
"""

from pathlib import Path

from pipeline import figure_style as style
from pipeline import paper_laboratory_report as report
from pipeline.config import Config, stage
from pipeline.output import write_text
from pipeline.paper_laboratory_study import study_of

FOLDER = Path("results/paper")


@stage
def main(config: Config) -> None:
    """Write the report, its numbers and its figure."""
    study = study_of(config)
    write_text(FOLDER / "laboratory.json", report.numbers(study))
    write_text(FOLDER / "laboratory.md", report.text(study))
    style.save(report.figure(study), FOLDER / "laboratory.png")
    print(FOLDER / "laboratory.md")


if __name__ == "__main__":
    main()
