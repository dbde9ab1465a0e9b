"""Stage `paper_convergence`: how the quadratic terms and the lever arm settle (Figs. 3 and 4).

Usage: ``python -m pipeline.paper_convergence truth=paper estimator=one_pass campaign.runs=96``

Writes ``results/paper/convergence.md``, ``.json`` and ``.png``, and its claims: the errors over
time of one run and the percentiles of several, of the first pass alone, which is the classical
filter.

For example::

    python -m pipeline.paper_convergence truth=paper estimator=one_pass campaign.runs=96

Reads: truth schedule noise disturbance estimator campaign.runs campaign.seed site simulation sensor
bounds.
"""

from pipeline.config.schema import Config
from pipeline.config.stage import stage
from pipeline.paper import convergence
from pipeline.paper.pages import write_page


@stage
def main(config: Config) -> None:
    """Write the report, its numbers and its figure."""
    study = convergence.study_of(config)
    write_page(
        "convergence",
        convergence.text(study),
        convergence.claims_of(study),
        convergence.numbers(study),
        convergence.figure(study),
    )


if __name__ == "__main__":
    main()
