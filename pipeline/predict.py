"""Stage `predict`: sigma of every parameter from the covariance recursion alone, no simulation.

Usage: ``python -m pipeline.predict [schedule=...] [noise=...] [out=FILE]``

For example::

    python -m pipeline.predict schedule=position19
    python -m pipeline.predict noise.gyro_angle_random_walk_deg_per_sqrt_h=0.002 out=predicted.json

Reads: schedule noise estimator out sensor site bounds.
"""

import numpy as np

from inscal.parameters import COUNT, NAMES, UNITS
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.config.stage import stage
from pipeline.console.output import complain, write_json
from pipeline.console.terminal import new_table, show


@stage
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
        std = np.sqrt(np.diag(setup.gains.covariance)[COUNT + 3 :]) / setup.augmented_unit
        table = new_table(("augmented state", "unit"), ("predicted_std",))
        for name, unit, sigma in zip(
            setup.augmented_names, setup.augmented_units, std, strict=True
        ):
            table.add_row(name, unit, f"{sigma:.4g}")
        show("augmented states that do not wander", table)
    if config.out:
        content = {"parameter": NAMES, "unit": UNITS, "predicted_std": std.tolist()}
        write_json(config.out, content, indent=2)


if __name__ == "__main__":
    main()
