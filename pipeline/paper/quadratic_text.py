"""The page on the unit of the quadratic terms."""

from collections.abc import Mapping

import numpy as np

from inscal.parameters import INDEX, NAMES
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.paper import claims
from pipeline.study import verdict as verdicts
from pipeline.study.findings import ENOUGH
from pipeline.study.observability import Course
from pipeline.study.verdict import MET, NOT_MET, Verdict
from pipeline.words import markdown as md

Readings = Mapping[tuple[str, str], Course]
"""Predictions by `sensor.quadratic_unit` and noise."""


def quadratic_text(config: Config, readings: Readings) -> str:
    """Compose the page on the unit of the quadratic terms.

    Parameters
    ----------
    config : Config
    readings : mapping of (str, str) to Course
        By `sensor.quadratic_unit` and noise.

    Returns
    -------
    str
        Markdown.
    """
    bound, numbers = Setup(config).bound, np.arange(len(NAMES))
    texts, judged = _reading_texts(config), judge(config, readings)
    rows = [
        (
            texts[unit],
            noise,
            md.code(NAMES[index]),
            f"{course.final_std[index]:.3g}",
            f"{100 * course.share[-1, index]:.2g} %",
            f"{bound[index]:g}",
            f"{bound[index] / course.final_std[index]:.2g}",
        )
        for (unit, noise), course in readings.items()
        for index in (*numbers[INDEX["accel_quadratic"]], *numbers[INDEX["accel_bias"]])
    ]
    headings = ("reading of 1e-9", "noise", "parameter", "sigma", "of the initial one", "bound")
    sections = (
        f"# {judged.title}",
        "The paper prints its quadratic terms in 1e-9 s²/m and writes them on pulse rates. The "
        "default here is pulse rates; `sensor.quadratic_unit=si` reads the unit at face value. "
        f"Both are predicted by the covariance recursion for {config.schedule.name}; quadratic "
        "terms in 1e-9, biases in µg. The filter's initial sigma is "
        f"{md.sizes(config.estimator.initial_std.accel_quadratic_1e_9)}e-9 in either reading, the "
        "size of the errors that the paper simulates.",
        "Claim of the paper: quadratic terms better than "
        f"{md.sizes(config.bounds.accel_quadratic_1e_9)}e-9.",
        judged.table,
        md.table((*headings, "bound / sigma"), rows, 3),
        _consequence(config, readings),
    )
    return "\n\n".join(sections) + "\n"


def judge(config: Config, readings: Readings) -> claims.Page:
    """Verdicts on the bound of the quadratic terms, by reading and noise."""
    texts, bound = _reading_texts(config), Setup(config).bound
    found = [
        (texts[unit], noise, bound_verdict(course, bound))
        for (unit, noise), course in readings.items()
    ]
    return claims.Page(
        "What 1e-9 of quadratic term means",
        ("reading", "noise", "ours", "verdict"),
        [(reading, noise, verdict.found, verdict.word) for reading, noise, verdict in found],
        bold=(NOT_MET,),
    )


def bound_verdict(course: Course, bound: np.ndarray) -> Verdict:
    """Judge by predicted sigma whether the bound of the quadratic terms holds in enough runs."""
    quadratic = INDEX["accel_quadratic"]
    sigmas = (bound / course.final_std)[quadratic].min()
    left = course.share[-1, quadratic].max()
    return verdicts.judged(
        "the bound of the quadratic terms holds",
        bool(sigmas >= verdicts.sigmas_of(ENOUGH)),
        f"bound at {sigmas:.2g} sigmas, {100 * left:.2g} % of the initial sigma left",
    )


def _reading_texts(config: Config) -> dict[str, str]:
    return {
        "pulse": f"on pulse rates, {config.sensor.accel_pulses_per_m_per_s:g} pulses per m/s",
        "si": "SI at face value, s²/m",
    }


def _consequence(config: Config, readings: Readings) -> str:
    bound, bias = Setup(config).bound, INDEX["accel_bias"]
    pulse, si = (readings[unit, config.noise.name] for unit in ("pulse", "si"))
    ratio = (si.final_std / pulse.final_std)[bias]
    held = {unit for (unit, _), c in readings.items() if bound_verdict(c, bound).word == MET}
    reach = (
        "only one of the two leaves the bound within reach of these noise levels"
        if len(held) == 1
        else "the bound does not tell the two apart at these noise levels"
    )
    return (
        f"Read in SI, the sigma of the accelerometer biases is {ratio.min():.2f} to "
        f"{ratio.max():.2f} of what it is on pulse rates: a quadratic term known beforehand to a "
        "fraction of a µg at 1 g need not be told from the bias. Which reading the paper means "
        "cannot be judged, because it states no unit of its scale factor; as for evidence, "
        f"{reach}."
    )
