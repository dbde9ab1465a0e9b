"""One sensor error alone in three environments (Figs. 1 and 2)."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from inscal import effects, units
from inscal.directions import AXES
from inscal.effects import Course, Environment
from inscal.motion import Site
from inscal.parameters import COUNT, INDEX
from pipeline.charts import style
from pipeline.config.setup import Setup
from pipeline.console.output import json_text
from pipeline.console.progress import track
from pipeline.paper import claims
from pipeline.paper import values as paper_values
from pipeline.paper.claims import TEMPLATES
from pipeline.paper.config import PaperConfig
from pipeline.study import verdict as verdicts
from pipeline.study.verdict import Verdict
from pipeline.words.render import render, sentence

QUADRATIC, LEVER_ARM = "quadratic term", "inner lever arm"
CASES = (QUADRATIC, LEVER_ARM)
REST, VIBRATION, SWING = "rest", "vibration", "swing"

_PAPER = {
    (QUADRATIC, VIBRATION): paper_values.VIBRATION_VELOCITY_ERROR,
    (LEVER_ARM, SWING): paper_values.SWING_VELOCITY_ERROR,
}
_OF_SIZE = 0.1  # a size within a tenth of the paper's is its size
_AGREES = 0.02  # of the analytic amplitude: the Foucault rotation takes some of it
_NEGLIGIBLE = 0.01  # share of the paper's magnitude of the same error elsewhere
_COURSE_INTERVAL_S = 10.0
_COLORS = {REST: "#009E73", VIBRATION: "#D55E00", SWING: "#0072B2"}
_DASHES = {REST: "-", VIBRATION: "-", SWING: (0, (6, 2))}


@dataclass(frozen=True)
class Study:
    """Courses of all environments, and what theory expects of the two that matter.

    Attributes
    ----------
    courses : dict of str to Course
        By environment, the cases in the order of `CASES`.
    other_swings : dict of str to Course
        The swing about the other two axes, by their names.
    expected : dict of (case, environment) to float
        Analytic amplitude of the north velocity error, m/s.
    schuler_rate : float
        rad/s.
    """

    config: PaperConfig
    courses: dict[str, Course]
    other_swings: dict[str, Course]
    expected: dict[tuple[str, str], float]
    schuler_rate: float

    def largest(self, case: str, environment: str) -> float:
        """Largest north velocity error, m/s."""
        return largest(self.courses[environment], case)


def largest(course: Course, case: str) -> float:
    """Largest north velocity error of a case, m/s."""
    return float(np.abs(course.north[:, CASES.index(case)]).max())


def swing_about(config: PaperConfig, axis: str) -> Environment:
    """Swing of the configuration, about an axis."""
    own = config.effects
    return Environment(
        step=1.0 / own.swing_rate_hz,
        frequency=own.swing_frequency_hz,
        angle=own.swing_amplitude_deg * units.DEGREE,
        axis=AXES.index(axis),
    )


def environments(config: PaperConfig) -> dict[str, Environment]:
    """Environments of the configuration."""
    own = config.effects
    amplitude = np.sqrt(2.0) * own.vibration_rms_g * units.STANDARD_GRAVITY
    return {
        REST: Environment(own.static_step_s),
        VIBRATION: Environment(
            1.0 / own.vibration_rate_hz,
            frequency=own.vibration_frequency_hz,
            acceleration=float(amplitude),
        ),
        SWING: swing_about(config, own.swing_axis),
    }


def truths(config: PaperConfig) -> np.ndarray:
    """Sensor parameters of the cases, shape (27, 2), SI: errors of the x accelerometer."""
    # those of the y accelerometer drive the east channel, whose Foucault share would blur theory
    own, out = config.effects, np.zeros((COUNT, len(CASES)))
    out[INDEX["accel_quadratic"].start, 0] = own.quadratic_1e_9 * Setup(config).quadratic_unit
    out[INDEX["lever_arm"].start, 1] = own.lever_arm_mm * units.MILLIMETRE
    return out


def study_of(config: PaperConfig) -> Study:
    """Navigate all cases through all environments."""
    site, truth, own = Setup(config).site, truths(config), config.effects

    def course(environment: Environment) -> Course:
        return effects.north_errors(
            environment, truth, site, duration=own.duration_s, interval=_COURSE_INTERVAL_S
        )

    return Study(
        config=config,
        courses={
            name: course(where)
            for name, where in track(environments(config).items(), "environments")
        },
        other_swings={
            axis: course(swing_about(config, axis)) for axis in AXES if axis != own.swing_axis
        },
        expected=_expected(config, site),
        schuler_rate=effects.schuler_rate(site),
    )


def _expected(config: PaperConfig, site: Site) -> dict[tuple[str, str], float]:
    own, rate = config.effects, effects.schuler_rate(site)
    vibration = effects.vibration_error(
        own.quadratic_1e_9 * Setup(config).quadratic_unit,
        own.vibration_rms_g * units.STANDARD_GRAVITY,
    )
    out = {(QUADRATIC, VIBRATION): vibration / rate}
    if own.swing_axis == "Z":  # the analytic mean is that of a swing about the vertical
        swing = effects.swing_error(
            own.lever_arm_mm * units.MILLIMETRE,
            own.swing_amplitude_deg * units.DEGREE,
            own.swing_frequency_hz,
        )
        out[LEVER_ARM, SWING] = swing / rate
    return out


def judge(study: Study) -> list[Verdict]:
    """Verdicts: the two magnitudes, everything else negligible, and theory."""
    out = []
    for (case, environment), paper in _PAPER.items():
        found = study.largest(case, environment)
        out.append(
            verdicts.near(
                f"{case} in {environment}: {paper:g} m/s",
                *(found, paper, _OF_SIZE),
                f"{found:.2f} m/s",
            )
        )
    for case, (_, paper) in zip(CASES, _PAPER.items(), strict=True):
        for environment in study.courses:
            if (case, environment) not in _PAPER:
                found = study.largest(case, environment)
                out.append(
                    verdicts.within(
                        f"{case} in {environment}: negligible (under {_NEGLIGIBLE * paper:g} m/s)",
                        *(found, _NEGLIGIBLE * paper),
                        f"{found:.2g} m/s",
                    )
                )
    for (case, environment), expected in study.expected.items():
        found = study.largest(case, environment)
        out.append(
            verdicts.near(
                f"theory of {case} in {environment}: {expected:.3f} m/s",
                *(found, expected, _AGREES),
                f"{found:.3f} m/s",
            )
        )
    return out


def claims_of(study: Study) -> claims.Page:
    """Give the verdicts as the claims of the page."""
    return claims.page_of(
        "What single sensor errors do to navigation (Figs. 1 and 2)", judge(study)
    )


def text(study: Study) -> str:
    """Compose the report in Markdown."""
    own, config = study.config.effects, study.config
    rows = [
        (name, *(f"{study.largest(case, name):.3g}" for case in CASES)) for name in study.courses
    ]
    rows += [
        (f"swing about {axis} instead", *(f"{largest(course, case):.3g}" for case in CASES))
        for axis, course in study.other_swings.items()
    ]
    return render(
        TEMPLATES,
        "effects.md.jinja",
        claims=claims_of(study),
        own=own,
        quadratic_si=own.quadratic_1e_9 * Setup(config).quadratic_unit,
        quadratic_unit=config.sensor.quadratic_unit,
        quarter_min=0.25 * 2.0 * np.pi / study.schuler_rate / 60.0,
        rows=rows,
        headings=("environment", *CASES),
        other_swings=other_swings_text(study),
    )


def other_swings_text(study: Study) -> str:
    """Say whether a swing about another axis lets the quadratic term matter."""
    limit = _NEGLIGIBLE * _PAPER[QUADRATIC, VIBRATION]
    worst = {axis: largest(course, QUADRATIC) for axis, course in study.other_swings.items()}
    matter = [f"{value:.2g} m/s about {axis}" for axis, value in worst.items() if value > limit]
    return sentence(TEMPLATES, "other_swings", swings=matter)


@style.styled
def figure(study: Study) -> Figure:
    """North velocity error over time, a panel per sensor error, with the paper's magnitude."""
    out = Figure(figsize=(10, 5))
    panels = out.subplots(1, len(CASES))
    for axes, case in zip(panels, CASES, strict=True):
        _draw(axes, study, case)
    out.suptitle("North velocity error by one sensor error alone, height held")
    return out


def _draw(axes: Axes, study: Study, case: str) -> None:
    for name, course in study.courses.items():
        axes.plot(
            course.time,
            course.north[:, CASES.index(case)],
            color=_COLORS[name],
            linestyle=_DASHES[name],
            label=name,
        )
    for (own, environment), expected in study.expected.items():
        if own == case:
            time = study.courses[environment].time
            axes.plot(
                time,
                -expected * np.sin(study.schuler_rate * time),
                color=style.PREDICTION_COLOR,
                linestyle=":",
                label=f"theory, {environment}",
            )
    ((environment, paper),) = [(key[1], v) for key, v in _PAPER.items() if key[0] == case]
    for end in (-paper, paper):
        axes.axhline(end, color=style.LIMIT_COLOR, linestyle="--", linewidth=1)
    axes.plot(
        [],
        [],
        color=style.LIMIT_COLOR,
        linestyle="--",
        linewidth=1,
        label=f"±{paper:g} m/s: the paper's, {environment}",
    )
    axes.set_title(case)
    axes.set_xlabel("time, s")
    axes.set_ylabel("north velocity error, m/s")
    axes.set_ylim(-1.25 * paper, 1.9 * paper)
    axes.legend(loc="upper left", ncols=2, fontsize=8)


def numbers(study: Study) -> str:
    """JSON text of the largest errors, m/s."""
    content = {
        case: {name: study.largest(case, name) for name in study.courses}
        | {
            f"swing about {axis}": largest(course, case)
            for axis, course in study.other_swings.items()
        }
        | {f"theory, {e}": value for (c, e), value in study.expected.items() if c == case}
        for case in CASES
    }
    return json_text(content)
