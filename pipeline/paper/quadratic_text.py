"""The page on the unit of the quadratic terms."""

from collections.abc import Mapping

import numpy as np

from inscal.parameters import INDEX, NAMES
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.paper.structure_text import MET, verdict_text
from pipeline.study.observability import Course
from pipeline.words import markdown as md

_MANY_SIGMAS = 2.576  # a bound this many sigmas away holds in 99 % of calibrations


def quadratic_text(config: Config, readings: Mapping[tuple[str, str], Course]) -> str:
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
    texts = {
        "pulse": f"on pulse rates, {config.sensor.accel_pulses_per_m_per_s:g} pulses per m/s",
        "si": "SI at face value, s²/m",
    }
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
    verdicts = [
        (texts[unit], noise, *bound_verdict(course, bound))
        for (unit, noise), course in readings.items()
    ]
    headings = ("reading of 1e-9", "noise", "parameter", "sigma", "of the initial one", "bound")
    sections = (
        "# What 1e-9 of quadratic term means",
        "The paper prints its quadratic terms in 1e-9 s²/m and writes them on pulse rates. The "
        "default here is pulse rates; `sensor.quadratic_unit=si` reads the unit at face value. "
        f"Both are predicted by the covariance recursion for {config.schedule.name}; quadratic "
        "terms in 1e-9, biases in µg. The filter's initial sigma is "
        f"{md.sizes(config.estimator.initial_std.accel_quadratic_1e_9)}e-9 in either reading, the "
        "size of the errors that the paper simulates.",
        "Claim of the paper: quadratic terms better than "
        f"{md.sizes(config.bounds.accel_quadratic_1e_9)}e-9.",
        md.table(("reading", "noise", "ours", "verdict"), verdicts, 4),
        md.table((*headings, "bound / sigma"), rows, 3),
        _consequence(config, readings),
    )
    return "\n\n".join(sections) + "\n"


def bound_verdict(course: Course, bound: np.ndarray) -> tuple[str, str]:
    """Judge by predicted sigma whether the bound of the quadratic terms holds."""
    quadratic = INDEX["accel_quadratic"]
    sigmas = (bound / course.final_std)[quadratic].min()
    left = course.share[-1, quadratic].max()
    found = f"bound at {sigmas:.2g} sigmas, {100 * left:.2g} % of the initial sigma left"
    return found, verdict_text(bool(sigmas >= _MANY_SIGMAS))


def _consequence(config: Config, readings: Mapping[tuple[str, str], Course]) -> str:
    bound, bias = Setup(config).bound, INDEX["accel_bias"]
    pulse, si = (readings[unit, config.noise.name] for unit in ("pulse", "si"))
    ratio = (si.final_std / pulse.final_std)[bias]
    held = {unit for (unit, _), c in readings.items() if MET == bound_verdict(c, bound)[1]}
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
