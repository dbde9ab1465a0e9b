"""Stage `frontier`: how accurate a calibration can be in how much time.

Usage: ``python -m pipeline.frontier [out=FILE.json]``

Predicts the inherited schedules, scaled in time, and searches for a designed one, at the noise
levels and times of conf/study.yaml; campaigns made are marked. Writes results/frontier.md, .json
and .png, or FILE and what is beside it.

For example::

    python -m pipeline.frontier
    python -m pipeline.frontier design.seed=2 out=mine.json

Reads: schedule truth estimator design out site simulation sensor bounds.
"""

from pathlib import Path

from pipeline.charts import style
from pipeline.charts.frontier import frontier
from pipeline.config.schema import Config
from pipeline.config.stage import stage
from pipeline.console.output import write_found
from pipeline.study.frontier import content, page

_FILE = "results/frontier.json"


@stage(writes=(".json", ".md", ".png"))
def main(config: Config) -> None:
    """Predict, search and draw."""
    found = content(config)
    path = Path(config.out or _FILE)
    style.save(frontier(found), path.with_suffix(".png"))
    write_found(path, found, page(found))


if __name__ == "__main__":
    main()
