"""Stage `figures`: the campaigns and comparisons as pictures in ``results/figures``.

Usage: ``python -m pipeline.figures``, after the stages simulate and compare.

Reads: bounds.
"""

from pathlib import Path

from matplotlib.figure import Figure

from pipeline.charts import campaigns as plots
from pipeline.charts import style
from pipeline.config.schema import Config
from pipeline.config.stage import stage
from pipeline.console.progress import track
from pipeline.study import campaign, findings, names

FOLDER = Path("results/figures")


def draw_all(config: Config) -> dict[str, Figure]:
    """Draw every figure of the default campaigns; DataError if an input is missing.

    Parameters
    ----------
    config : Config
        Gives the bounds.

    Returns
    -------
    dict of str to Figure
        By file name.
    """
    levels = {name: campaign.read(config, names.RUNS / name) for name in names.MAIN_LEVELS}
    noises = {level.configuration["noise"]["name"]: level for level in levels.values()}
    reference = levels[names.MAIN]
    passes = {1: campaign.read(config, names.RUNS / names.ONE_PASS), 2: reference}
    comparisons = {title: findings.read_comparison(name) for name, title in names.DRAWN.items()}
    noise = reference.configuration["noise"]
    return {
        "errors_against_bounds.png": plots.errors_against_bounds(noises),
        "error_distributions.png": plots.error_distributions(reference),
        "predicted_against_empirical.png": plots.predicted_against_empirical(passes),
        "nees.png": plots.nees(passes),
        "schedule_comparison.png": plots.schedule_comparison(
            comparisons, f"{noise['name']} noise: {style.noise_text(noise)}"
        ),
    }


@stage
def main(config: Config) -> None:
    """Draw every figure."""
    for name, figure in track(draw_all(config).items(), "figures"):
        style.save(figure, FOLDER / name)
        print(FOLDER / name)


if __name__ == "__main__":
    main()
