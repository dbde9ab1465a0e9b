"""Stage `report`: what the campaigns show, in ``results/report.md`` and ``results/report.html``.

Usage: ``python -m pipeline.report [campaigns=[STORE,...]] [out=FILE.html]``. Without arguments it
reports on the study, after summarize, compare and figures; the reproduction of the paper is in it
where `paper` has left its claims. With `campaigns` it writes a page of these stores alone, the
first being the main one, to `out` or beside the first store; they may be half-finished. The text is
composed from the numbers: no result is written here, and every verdict follows by a rule of
`pipeline.study.findings`.

For example::

    python -m pipeline.report
    python -m pipeline.report campaigns=[results/runs/a,results/runs/b] out=ab.html

Reads: campaigns out bounds.
"""

from pipeline.config.schema import Config
from pipeline.config.stage import stage
from pipeline.console.errors import ConfigError
from pipeline.console.output import write_text
from pipeline.page import compose as page
from pipeline.study import assumptions, findings
from pipeline.study.report import PAGE, PATH, report_text


@stage(writes=(".html",))
def main(config: Config) -> None:
    """Write the report of the study, or a page of the campaigns asked for."""
    if config.campaigns is not None:
        path = page.output_path(config)
        write_text(path, page.html(page.campaigns(config, config.campaigns)))
        print(path)
        return
    if config.out:
        raise ConfigError(f"out = {config.out!r}: must be null without campaigns")
    text = report_text(findings.collect(assumptions.read()))
    html = page.html(page.study(config))
    write_text(PATH, text)
    write_text(PAGE, html)
    print(PATH, PAGE, sep="\n")


if __name__ == "__main__":
    main()
