"""Stage `paper-ablation`: what leaving out quadratic terms and lever arms costs, and its figure.

Usage: ``python -m pipeline.paper_ablation``, after the campaigns of the filters with fewer states.
Writes ``ablation.md``, ``ablation.csv`` and ``ablation.png`` in ``results/paper``.

Reads: bounds schedule.
"""

from pipeline.charts import style
from pipeline.config.schema import Config
from pipeline.config.stage import stage
from pipeline.console.output import write_text
from pipeline.console.progress import track
from pipeline.paper import claims
from pipeline.paper.ablation import TRUTHS, ablation_of, table
from pipeline.paper.ablation_figure import ablation_figure
from pipeline.paper.ablation_text import ablation_text, judge
from pipeline.paper.claims import FOLDER
from pipeline.study import names


@stage
def main(config: Config) -> None:
    """Write page, table and figure."""
    ablations = {
        truth: ablation_of(config, names.RUNS / name)
        for truth, name in track(TRUTHS.items(), "filters of fewer states")
    }
    style.save(ablation_figure(ablations), FOLDER / "ablation.png")
    claims.write("ablation", judge(ablations))
    for name, text in (
        ("ablation.md", ablation_text(config, ablations)),
        ("ablation.csv", table(ablations)),
    ):
        write_text(FOLDER / name, text)
        print(FOLDER / name)


if __name__ == "__main__":
    main()
