"""Stage `predict`: sigma of every parameter from the covariance recursion alone, no simulation.

Usage: ``python -m pipeline.predict [schedule=...] [noise=...] [out=FILE]``

What the path does not tell apart is named, with what would; of any state model (`estimator`). The
share of runs that keep all bounds is predicted, and what noise or time would be enough.

For example::

    python -m pipeline.predict schedule=position19
    python -m pipeline.predict noise.gyro_angle_random_walk_deg_per_sqrt_h=0.002 out=predicted.json
    python -m pipeline.predict estimator=robust

Reads: schedule noise estimator out sensor simulation site bounds.
"""

import numpy as np

from inscal.parameters import COUNT, NAMES, UNITS
from inscal.recursion import ATTITUDE
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.config.stage import stage
from pipeline.console.output import complain, write_json
from pipeline.console.terminal import new_table, say, show, show_augmented, show_rows
from pipeline.study import unseen
from pipeline.study.predicted import line, predicted


@stage(writes=(".json",))
def main(config: Config) -> None:
    """Print the table; write it as JSON where `out` says."""
    setup = Setup(config)
    complain(setup.warnings)
    std = setup.gains.parameter_std[-1] / setup.unit
    table = new_table(("parameter", "unit"), ("predicted_std", "bound", "bound / sigma"))
    for name, unit, sigma, limit in zip(NAMES, UNITS, std, setup.bound, strict=True):
        ratio = f"{limit / sigma:.1f}" if sigma > 0 else "not modelled"
        table.add_row(name, unit, f"{sigma:.4g}", f"{limit:g}", ratio)
    show(f"predicted 1 sigma: {config.schedule.name}, noise {config.noise.name}", table)
    if setup.augmented_names:
        own = np.sqrt(np.diag(setup.gains.covariance)[COUNT + ATTITUDE :]) / setup.augmented_unit
        texts = [f"{sigma:.4g}" for sigma in own]
        rows = zip(setup.augmented_names, setup.augmented_units, texts, strict=True)
        show_augmented(("predicted_std",), rows)
    if hidden := unseen.rows(setup):
        show_rows(unseen.TITLE, unseen.HEADINGS[:1], unseen.HEADINGS[1:], hidden)
    found = predicted(setup)
    say(line(found))
    if config.out:
        content = {
            "parameter": NAMES,
            "unit": UNITS,
            "predicted_std": std.tolist(),
            "bound": setup.bound.tolist(),
            "joint_share": found.share,
            "joint_share_asked": found.asked,
            "worst": found.worst,
            "noise_factor": found.noise_factor,
            "time_factor": found.time_factor,
        }
        write_json(config.out, content, indent=2)


if __name__ == "__main__":
    main()
