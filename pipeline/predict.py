"""Stage `predict`: sigma of every parameter from the covariance recursion alone, no simulation.

Usage: ``python -m pipeline.predict [schedule=...] [noise=...] [out=FILE]``
"""

import json

from rich.console import Console
from rich.table import Table

from inscal.parameters import NAMES, UNITS
from inscal.recursion import compute_gains
from inscal.state_model import StateModel, build_transitions
from pipeline.build import (
    build_initial_std,
    build_noise,
    build_schedule,
    build_site,
    parameter_vector,
    si_units,
    warnings,
)
from pipeline.config import Config, stage
from pipeline.output import complain, write_text


@stage
def main(config: Config) -> None:
    """Print the table; write it as JSON where `out` says."""
    complain(warnings(config))
    model, noise = StateModel(tuple(config.estimator.states)), build_noise(config)
    transitions = build_transitions(
        build_schedule(config),
        build_site(config),
        model,
        noise,
        update_interval=config.estimator.update_interval_s,
    )
    gains = compute_gains(transitions, model, noise, build_initial_std(config))
    std = gains.parameter_std[-1] / si_units(config)
    bound = parameter_vector(config.bounds)
    table = Table(title=f"predicted 1 sigma: {config.schedule.name}, noise {config.noise.name}")
    for heading in ("parameter", "unit", "predicted_std", "bound", "bound / sigma"):
        table.add_column(heading, justify="left" if heading in ("parameter", "unit") else "right")
    for name, unit, sigma, limit in zip(NAMES, UNITS, std, bound, strict=True):
        ratio = f"{limit / sigma:.1f}" if sigma > 0 else "not modelled"
        table.add_row(name, unit, f"{sigma:.4g}", f"{limit:g}", ratio)
    Console().print(table)
    if config.out:
        content = {"parameter": NAMES, "unit": UNITS, "predicted_std": std.tolist()}
        write_text(config.out, json.dumps(content, indent=2) + "\n")


if __name__ == "__main__":
    main()
