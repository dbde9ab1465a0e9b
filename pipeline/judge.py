"""Stage `judge`: estimates of any program, judged by the campaign whose runs they are of.

Usage: ``python -m pipeline.judge estimates=FILE campaign.store=STORE [mapping=FILE] [out=JSON]``

The table, CSV or Parquet, has a column ``run``, one for each parameter by the project's name and
printed unit, and ``<parameter>_std`` where there is a sigma. A mapping in YAML says what other
columns are. A run that is missing or not finite has failed and misses every bound.

For example::

    python -m pipeline.judge estimates=mine.csv campaign.store=results/runs/x out=mine.json

Reads: estimates mapping campaign.store bounds out.
"""

from pipeline.config.schema import Config
from pipeline.config.stage import stage
from pipeline.console.errors import ConfigError
from pipeline.console.output import write_found
from pipeline.console.terminal import say, show_rows
from pipeline.study.findings import contest, contest_verdict, joint_text
from pipeline.study.others import HEADINGS, content, judge, page, rows


@stage(writes=(".json", ".md"))
def main(config: Config) -> None:
    """Judge, print and write."""
    if config.estimates is None:
        raise ConfigError("estimates = null: must be the path of a table of estimates")
    found = judge(config)
    show_rows(str(config.estimates), HEADINGS[:2], HEADINGS[2:6], [r[:6] for r in rows(found)])
    print(f"all within bounds at once: {joint_text(found.summary)} of runs")
    say(contest_verdict(contest(found.comparison)))
    if config.out:
        write_found(config.out, content(found), page(found))


if __name__ == "__main__":
    main()
