"""Stage `paper-structure`: the paper's path, its observability table and the unit of D2, judged.

Usage: ``python -m pipeline.paper_structure``. Writes ``observability.md`` and ``quadratic_unit.md``
with their tables and figures in ``results/paper``. Every verdict follows from the numbers.

Reads: schedule noise estimator site sensor bounds.
"""

from pipeline.charts import style
from pipeline.charts.observability import sigma_heat_map
from pipeline.config.schema import Config
from pipeline.config.stage import stage
from pipeline.console.output import write_text
from pipeline.console.progress import busy
from pipeline.paper import claims, quadratic_text, structure_text
from pipeline.paper.claims import FOLDER
from pipeline.paper.rank_figure import rank_figure
from pipeline.paper.structure import SEARCHED, Structure, rank_table, readings_of, structure_of
from pipeline.paper.tables import TABLE_2_RANKS
from pipeline.study.observability import CONVENTIONS, share_table


def write_figures(config: Config, structure: Structure) -> None:
    """Draw ranks and sigmas by position."""
    setup = f"{len(structure.full.share)} positions, {config.noise.name} noise"
    shown = {name: structure.counts[name].by_default.rank for name in (*CONVENTIONS, SEARCHED)}
    style.save(rank_figure(TABLE_2_RANKS, shown), FOLDER / "ranks.png")
    style.save(sigma_heat_map(structure.full.share, setup), FOLDER / "sigma_by_position.png")


@stage
def main(config: Config) -> None:
    """Write pages, tables and figures."""
    with busy("ranks and sigmas along the path"):
        structure, readings = structure_of(config), readings_of(config)
    write_figures(config, structure)
    claims.write("observability", structure_text.judge(structure))
    claims.write("quadratic_unit", quadratic_text.judge(config, readings))
    texts = {
        "observability.md": structure_text.observability_text(config, structure),
        "quadratic_unit.md": quadratic_text.quadratic_text(config, readings),
        "ranks.csv": rank_table(structure),
        "sigma_by_position.csv": share_table(structure.full),
    }
    for name, text in texts.items():
        write_text(FOLDER / name, text)
        print(FOLDER / name)


if __name__ == "__main__":
    main()
