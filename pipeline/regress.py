"""Stage `regress`: the gate, which tells whether this code is worse than the committed baseline.

Usage: ``python -m pipeline.regress [overrides]``, and ``"accept='reason'"``, with both quotes, to
make its campaigns the new baseline. One is the reference case, which the overrides change; it has
128 runs, whatever ``campaign.runs`` says. The others are those of ``conf/gate.yaml``.

With ``estimates=FILE baseline=DIR campaign.store=STORE`` another program's estimates of that
campaign's runs are judged by their own baseline (`pipeline.gate.others`), which ``accept`` makes.

Exit code 0: *identical* bit for bit, or *changed, no worse*. Exit code 1: *worse*, or a check of
consistency or of the bounds failed. Exit code 2: there is nothing to compare.

For example::

    python -m pipeline.regress
    python -m pipeline.regress out=results/gate.json    # with gate.xml (JUnit) and gate.md beside
    python -m pipeline.regress "accept='the filter has a third pass'"
    python -m pipeline.regress estimates=mine.csv baseline=mine campaign.store=results/runs/x

Reads: accept out estimates baseline mapping campaign.store schedule noise disturbance truth
estimator campaign.seed site simulation sensor bounds.
"""

from pipeline.config.schema import Config
from pipeline.config.stage import stage
from pipeline.gate import judge, others, told


@stage(writes=(".json", ".md", ".xml"))
def main(config: Config) -> None:
    """Compare with the baseline, or write a new one."""
    gate = judge if config.estimates is None else others
    if config.accept is not None:
        gate.accept(config, config.accept.strip())
        return
    report = gate.compare(config)
    told.show(report)
    if config.out:
        told.write(report, config.out)
    if report.verdict == told.WORSE:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
