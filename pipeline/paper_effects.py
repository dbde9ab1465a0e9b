"""Stage `paper_effects`: north velocity errors by the quadratic term and by the lever arm alone.

Usage: ``python -m pipeline.paper_effects [effects.vibration_rms_g=...]``

Writes ``results/paper/effects.md``, ``.json`` and ``.png``, and its claims.

For example::

    python -m pipeline.paper_effects effects.vibration_rms_g=0.5 effects.swing_axis=Y

Reads: effects site sensor.
"""

from pipeline.paper import effects
from pipeline.paper.config import PaperConfig, stage
from pipeline.paper.pages import write_page


@stage
def main(config: PaperConfig) -> None:
    """Write the report, its numbers and its figure."""
    study = effects.study_of(config)
    write_page(
        "effects",
        effects.text(study),
        effects.claims_of(study),
        effects.numbers(study),
        effects.figure(study),
    )


if __name__ == "__main__":
    main()
