"""Stage `design`: searches for the best schedule for a unit, a table and a time.

Usage: ``python -m pipeline.design [design.name=...] [design.total_time_s=...] [out=FILE.json]``

Anneals turns and unequal dwells, and judges every path by its exact covariance. Writes the schedule
to ``conf/schedule/<design.name>.yaml``, ready for use, and a page to results/design/<name>.md or
beside FILE. Ctrl-C keeps the best so far; design.start_from goes on from a schedule.

For example::

    python -m pipeline.design design.name=mine
    python -m pipeline.design design.objective=shortest design.joint_share=0.97 design.name=brisk
    python -m pipeline.design design.total_time_s=2500 noise=quiet design.seconds=30

Reads: schedule noise disturbance truth estimator design out site sensor bounds.
"""

from pathlib import Path

from pipeline.config.schema import Config
from pipeline.config.stage import stage
from pipeline.console.output import write_found, write_text
from pipeline.console.progress import note
from pipeline.study.design import Search
from pipeline.study.design_page import content, page, schedule_text


@stage(writes=(".json", ".md"))
def main(config: Config) -> None:
    """Search, and write what was found."""
    about = config.design
    search = Search(config)
    found = search.best(note)
    file = Path(about.folder) / f"{about.name}.yaml"
    into = config.out or f"results/design/{about.name}.json"
    share, total = 100 * found.path.share, found.path.total
    write_text(file, schedule_text(config, found))
    write_found(into, content(config, found), page(config, search, found))
    print(f"{about.name}: {share:.2f} % of runs keep all bounds in {total:g} s (predicted)")
    print(file)


if __name__ == "__main__":
    main()
