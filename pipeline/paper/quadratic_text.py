"""The page on the unit of the quadratic terms."""

from collections.abc import Mapping

import numpy as np

from inscal.parameters import INDEX, NAMES
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.paper import claims
from pipeline.paper.claims import TEMPLATES
from pipeline.paper.noise import SIGMAS
from pipeline.study import verdict as verdicts
from pipeline.study.observability import Observability
from pipeline.study.verdict import MET, NOT_MET, Verdict
from pipeline.words import markdown as md
from pipeline.words.render import render

Readings = Mapping[tuple[str, str], Observability]
"""Predictions by `sensor.quadratic_unit` and noise."""


def quadratic_text(config: Config, readings: Readings) -> str:
    """Compose the page on the unit of the quadratic terms.

    Parameters
    ----------
    config : Config
    readings : mapping of (str, str) to Observability
        By `sensor.quadratic_unit` and noise.

    Returns
    -------
    str
        Markdown.
    """
    texts, bound = _reading_texts(config), Setup(config).bound
    numbers = np.arange(len(NAMES))
    rows = [
        (
            texts[unit],
            noise,
            md.code(NAMES[index]),
            f"{found.final_std[index]:.3g}",
            f"{100 * found.share[-1, index]:.2g} %",
            f"{bound[index]:g}",
            f"{bound[index] / found.final_std[index]:.2g}",
        )
        for (unit, noise), found in readings.items()
        for index in (*numbers[INDEX["accel_quadratic"]], *numbers[INDEX["accel_bias"]])
    ]
    pulse, si = (readings[unit, config.noise.name] for unit in ("pulse", "si"))
    held = {
        unit for (unit, _), found in readings.items() if bound_verdict(found, bound).word == MET
    }
    return render(
        TEMPLATES,
        "quadratic_unit.md.jinja",
        claims=judge(config, readings),
        schedule=config.schedule.name,
        initial=config.estimator.initial_std.accel_quadratic_1e_9,
        bound=config.bounds.accel_quadratic_1e_9,
        rows=rows,
        ratio=(si.final_std / pulse.final_std)[INDEX["accel_bias"]],
        told_apart=len(held) == 1,
    )


def judge(config: Config, readings: Readings) -> claims.Page:
    """Verdicts on the bound of the quadratic terms, by reading and noise."""
    texts, bound = _reading_texts(config), Setup(config).bound
    judged = [
        (texts[unit], noise, bound_verdict(found, bound))
        for (unit, noise), found in readings.items()
    ]
    return claims.Page(
        "What 1e-9 of quadratic term means",
        ("reading", "noise", "ours", "verdict"),
        [(reading, noise, verdict.found, verdict.word) for reading, noise, verdict in judged],
        bold=(NOT_MET,),
    )


def bound_verdict(found: Observability, bound: np.ndarray) -> Verdict:
    """Judge by predicted sigma whether the bound of the quadratic terms holds in enough runs."""
    quadratic = INDEX["accel_quadratic"]
    sigmas = (bound / found.final_std)[quadratic].min()
    left = found.share[-1, quadratic].max()
    return verdicts.judged(
        "the bound of the quadratic terms holds",
        f"bound at {sigmas:.2g} sigmas, {100 * left:.2g} % of the initial sigma left",
        bool(sigmas >= SIGMAS),
    )


def _reading_texts(config: Config) -> dict[str, str]:
    return {
        "pulse": f"on pulse rates, {config.sensor.accel_pulses_per_m_per_s:g} pulses per m/s",
        "si": "SI at face value, s²/m",
    }
