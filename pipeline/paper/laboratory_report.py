"""Text, numbers and figure of the virtual laboratory experiment."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy import stats

from inscal import units
from inscal.effects import schuler_rate
from inscal.free_inertial import Flight
from inscal.parameters import COUNT, NAMES, UNITS
from pipeline.charts import style
from pipeline.config.setup import Setup
from pipeline.console.output import json_text
from pipeline.paper import claims
from pipeline.paper.laboratory_study import (
    COMPENSATED,
    PERFECT,
    UNCOMPENSATED,
    Residual,
    Study,
)
from pipeline.paper.values import NAVIGATION_POSITION_ERROR_NMI, NAVIGATION_VELOCITY_ERROR, TABLE_4
from pipeline.study import verdict as verdicts
from pipeline.study.verdict import Verdict
from pipeline.words import markdown as md

_WITHIN_NOISE = 2.0  # standard deviations of a difference that noise explains
_HONEST = 0.995  # quantile of the mean NEES up to which a calibration has converged
_LITTLE = 1.25  # times the floor
_SPREAD = 95.0  # per cent of runs
_COLORS = {COMPENSATED: style.NOISE_COLORS["reference"], PERFECT: style.NOISE_COLORS["quiet"]}


def largest_velocity(flight: Flight) -> np.ndarray:
    """Largest error of either velocity component of each run, m/s, shape (runs,)."""
    return np.abs(flight.velocity).max(axis=(0, 1))


def largest_distance(flight: Flight) -> np.ndarray:
    """Largest horizontal position error of each run, nautical miles, shape (runs,)."""
    distance = np.hypot(flight.position[:, 0], flight.position[:, 1])
    return distance.max(axis=0) / units.NAUTICAL_MILE


def final_rms(flight: Flight) -> float:
    """Rms over the runs of the horizontal position error at the end, nautical miles."""
    return float(np.sqrt(np.square(flight.position[-1]).sum(axis=0).mean()) / units.NAUTICAL_MILE)


def converged(residual: Residual) -> bool:
    """Whether no run diverged and the errors are those that the filter predicts."""
    limit = stats.chi2.ppf(_HONEST, COUNT * residual.runs) / residual.runs
    return residual.failed == 0 and bool(residual.nees <= limit)


def judge(study: Study) -> list[Verdict]:
    """Verdicts on the calibrations and on the flight."""
    flight, perfect = study.flights[COMPENSATED], study.flights[PERFECT]
    velocity, distance = largest_velocity(flight), largest_distance(flight)
    floor = largest_distance(perfect)
    limit = stats.chi2.ppf(_HONEST, COUNT * study.nees.size) / study.nees.size
    out = [
        verdicts.within(
            "Table 4's unit can be calibrated from a coarse scale",
            *(float(study.nees.mean()) if np.isfinite(study.nees).all() else np.inf, float(limit)),
            f"mean NEES {study.nees.mean():.1f}, {COUNT} expected, at most {limit:.1f}",
        ),
        verdicts.within(
            f"compensated, the velocity error stays under {NAVIGATION_VELOCITY_ERROR:g} m/s",
            *(_high(velocity), NAVIGATION_VELOCITY_ERROR),
            f"largest: {velocity[0]:.2f} m/s in run 0, {_high(velocity):.2f} m/s in "
            f"{_SPREAD:g} % of runs",
        ),
        verdicts.within(
            f"compensated, the position error stays under {NAVIGATION_POSITION_ERROR_NMI:g} nmi",
            *(_high(distance), NAVIGATION_POSITION_ERROR_NMI),
            f"largest: {distance[0]:.3f} nmi in run 0, {_high(distance):.3f} nmi in "
            f"{_SPREAD:g} % of runs",
        ),
        verdicts.within(
            "the same with perfectly known sensors, their noise alone",
            *(float(floor.min()), NAVIGATION_POSITION_ERROR_NMI),
            f"largest: {floor.min():.3f} nmi in the luckiest run, {_high(floor):.3f} nmi in "
            f"{_SPREAD:g} %",
        ),
    ]
    degrees = NAVIGATION_POSITION_ERROR_NMI * 60.0
    out.append(
        verdicts.within(
            f"read as {NAVIGATION_POSITION_ERROR_NMI:g}°, which is {degrees:g} nmi",
            *(_high(distance), degrees),
            f"{_high(distance):.3f} nmi in {_SPREAD:g} % of runs",
        )
    )
    return out


def _high(values: np.ndarray) -> float:
    return float(np.percentile(values, _SPREAD))


def claims_of(study: Study) -> claims.Page:
    """Give the verdicts as the claims of the page."""
    return claims.page_of(
        "The laboratory experiment, simulated (Table 4, Figs. 5 to 8)", judge(study)
    )


def text(study: Study) -> str:
    """Compose the report in Markdown."""
    sections = (
        f"# {claims_of(study).title}",
        _setup(study),
        claims_of(study).table,
        "## How coarse the coarse scale may be",
        _residuals(study),
        "## Repeatability of two calibrations",
        _repeatability(study),
        "## The path flown again",
        _flown(study),
    )
    return "\n\n".join(sections) + "\n"


def _setup(study: Study) -> str:
    config, runs = study.config, study.estimate.shape[1]
    own, first = config.laboratory, TABLE_4[0]
    left = np.abs(study.truth[0])
    gyro = left[[NAMES.index(f"gyro_k{i}{i}") for i in (1, 2, 3)]].max()
    accel = left[[NAMES.index(f"accel_k{i}{i}") for i in (1, 2, 3)]].max()
    return (
        f"Truth is what the paper found on {TABLE_4[0].date} and {TABLE_4[1].date}; one 1e-9 of "
        f"quadratic term is {Setup(config).quadratic_unit:.4g} s²/m "
        f"(`sensor.quadratic_unit={config.sensor.quadratic_unit}`). Gyro scale factors of "
        f"{md.listed(f'{s:.1f}' for s in first.gyro_scale_ppm)} ppm are no errors but relate to a "
        "nominal scale that is not stated, so coarse factors of "
        f"{md.sizes(own.coarse_gyro_scale_factor_ppm)} ppm and "
        f"{md.sizes(own.coarse_accel_pulses_per_m_per_s)} pulses per m/s are applied first. "
        f"Left to calibrate are up to {gyro:.0f} ppm of gyro and {accel:.0f} ppm of accelerometer "
        f"scale, up to {left.max():.0f} ug of bias. {runs} experiments, each of two calibrations "
        f"({style.passes_text(config.estimator.passes)}, priors of that width) and a flight with "
        f"noise of their own; {config.noise.name} noise ({style.noise_text(vars(config.noise))}), "
        "which is a choice: the paper states none."
    )


def _residuals(study: Study) -> str:
    lines = []
    for sensor in dict.fromkeys(r.sensor for r in study.residuals):
        for passes in dict.fromkeys(r.passes for r in study.residuals):
            own = [r for r in study.residuals if (r.sensor, r.passes) == (sensor, passes)]
            lines.append(f"{sensor}, {style.passes_text(passes)}: {reach_text(own)}")
    rows = [
        (
            *(r.sensor, f"{r.passes}", f"{r.ppm:g}", f"{r.failed} of {r.runs}"),
            *(f"{r.nees:.1f}" if np.isfinite(r.nees) else "-", "yes" if converged(r) else "no"),
        )
        for r in study.residuals
    ]
    headings = ("scale of", "passes", "residual, ppm", "diverged", "mean NEES", "converged")
    intro = (
        "Units whose only error is the scale of all three gyros or all three accelerometers, with "
        "a prior as wide as that error. Converged means that no run diverged and that the mean "
        f"NEES is what {COUNT} parameters make it."
    )
    return "\n\n".join((intro, md.bullets(lines), md.table(headings, rows, 1)))


def reach_text(residuals: list[Residual]) -> str:
    """Say up to which residual calibrations converge; `residuals` in ascending order."""
    failing = next((i for i, r in enumerate(residuals) if not converged(r)), None)
    if failing is None:
        return f"all converge, up to {residuals[-1].ppm:g} ppm"
    if failing == 0:
        return f"does not converge at {residuals[0].ppm:g} ppm, the smallest tried"
    return (
        f"converges up to {residuals[failing - 1].ppm:g} ppm, not at {residuals[failing].ppm:g} ppm"
    )


def repeatability(study: Study) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Differences of the second calibration from the first, in paper units.

    Returns
    -------
    paper : ndarray, shape (27,)
        The paper's, which are the drift of the simulated truth.
    ours : ndarray, shape (runs, 27)
    predicted : ndarray, shape (27,)
        Sigma of a difference without drift.
    """
    paper = study.truth[1] - study.truth[0]
    return paper, study.estimate[1] - study.estimate[0], np.sqrt(2.0) * study.sigma


def _repeatability(study: Study) -> str:
    paper, ours, predicted = repeatability(study)
    spread = np.sqrt(np.square((ours - paper) / predicted).mean())
    noise = np.abs(paper) <= _WITHIN_NOISE * predicted
    real = [NAMES[i] for i in np.flatnonzero(~noise)]
    rows = [
        (
            *(md.code(NAMES[i]), UNITS[i], f"{paper[i]:.3g}", f"{ours[0, i]:.3g}"),
            *(f"{predicted[i]:.2g}", f"{abs(paper[i]) / predicted[i]:.1f}"),
        )
        for i in style.ORDER
    ]
    headings = (
        *("parameter", "unit", "paper's difference", "ours, experiment 0"),
        *("sqrt(2) predicted sigma", "paper's over that"),
    )
    intro = (
        "The truth drifts by the paper's differences (gyro scale and installation as seen after "
        "the coarse scale, so divided by 1.44). Ours scatter about them by "
        f"{spread:.2f} times sqrt(2) predicted sigma, over {len(ours)} experiments. "
        f"{int(noise.sum())} of the paper's {len(paper)} differences are within "
        f"{_WITHIN_NOISE:g} such sigma; the other {len(real)}{md.named(real)} are real drift, or "
        "noise larger than the configured one."
    )
    return f"{intro}\n\n{md.table(headings, rows, 2)}"


def _flown(study: Study) -> str:
    rows = [
        (
            name,
            *(f"{v:.3g}" for v in (largest_velocity(flight)[0], _high(largest_velocity(flight)))),
            *(f"{v:.3g}" for v in (largest_distance(flight)[0], _high(largest_distance(flight)))),
            f"{final_rms(flight):.3g}",
        )
        for name, flight in study.flights.items()
    ]
    headings = (
        *("sensors", "velocity error, m/s, run 0", f"{_SPREAD:g} % of runs"),
        *("position error, nmi, run 0", f"{_SPREAD:g} % of runs", "rms at the end, nmi"),
    )
    floor, compensated = final_rms(study.flights[PERFECT]), final_rms(study.flights[COMPENSATED])
    needed = NAVIGATION_POSITION_ERROR_NMI / floor
    noise = study.config.noise.gyro_angle_random_walk_deg_per_sqrt_h
    duration = study.flights[PERFECT].time[-1]
    lines = (
        f"Free inertial for {duration:.0f} s along the path, height held, from perfect alignment, "
        "compensated by the second calibration or by nothing but the coarse scale. Largest errors "
        "of the flight:",
        md.table(headings, rows, 1),
        "![Velocity and position errors](laboratory.png)",
        f"At the end the position error is {compensated:.3f} nmi rms, against a floor of "
        f"{floor:.3f} nmi that the noise of perfectly known sensors leaves: calibration errors add "
        f"{'little' if compensated < _LITTLE * floor else 'much'}. For "
        f"{NAVIGATION_POSITION_ERROR_NMI:g} nmi rms all noise would have to be {needed:.3f} times "
        f"as large, the gyros' random walk {noise * needed:.1g} °/√h instead of {noise:g}. "
        + bounds_text(_schuler_swing(study)),
    )
    return "\n\n".join(lines)


def bounds_text(swing: float) -> str:
    """Say whether the paper's two bounds agree; `swing` as from its velocity bound, in nmi."""
    agree = swing <= NAVIGATION_POSITION_ERROR_NMI
    return (
        f"An oscillation of {NAVIGATION_VELOCITY_ERROR:g} m/s at the Schuler rate swings "
        f"{swing:.2f} nmi, {swing / NAVIGATION_POSITION_ERROR_NMI:.0f} times the printed bound of "
        f"position: the two printed bounds {'agree' if agree else 'do not go together'}."
    )


def _schuler_swing(study: Study) -> float:
    """Position amplitude, nmi, of an oscillation of the paper's velocity bound."""
    rate = schuler_rate(Setup(study.config).site)
    return NAVIGATION_VELOCITY_ERROR / rate / units.NAUTICAL_MILE


@style.styled
def figure(study: Study) -> Figure:
    """Velocity and position errors over the flight, compensated and not."""
    out = Figure(figsize=(11, 7.5))
    (left, right), (below, beside) = out.subplots(2, 2, sharex=True)
    _draw_velocity(left, study.flights[COMPENSATED])
    left.set_title("compensated by the second calibration")
    for end in (-NAVIGATION_VELOCITY_ERROR, NAVIGATION_VELOCITY_ERROR):
        left.axhline(end, color=style.LIMIT_COLOR, linestyle="--", linewidth=1)
    left.plot([], [], color=style.LIMIT_COLOR, linestyle="--", lw=1, label="the paper's bound")
    left.set_ylim(-1.3 * NAVIGATION_VELOCITY_ERROR, 1.8 * NAVIGATION_VELOCITY_ERROR)
    _draw_velocity(right, study.flights[UNCOMPENSATED])
    right.set_title("not compensated (coarse scale alone)")
    for name in (PERFECT, COMPENSATED):
        _draw_distance(below, study.flights[name], name, _COLORS[name])
    below.axhline(NAVIGATION_POSITION_ERROR_NMI, color=style.LIMIT_COLOR, linestyle="--", lw=1)
    below.plot([], [], color=style.LIMIT_COLOR, linestyle="--", lw=1, label="the paper's bound")
    _draw_distance(beside, study.flights[UNCOMPENSATED], UNCOMPENSATED, "#D55E00")
    for axes in (left, right):
        axes.set_ylabel("velocity error, m/s")
        axes.legend(loc="upper left", fontsize=8)
    for axes in (below, beside):
        axes.set_ylabel("horizontal position error, nmi")
        axes.set_xlabel("time, s")
        axes.legend(loc="upper left", fontsize=8)
    noise = study.config.noise
    out.suptitle(
        "The 25-position path flown again, free inertial, height held\n"
        f"{noise.name} noise: {style.noise_text(vars(noise))}"
    )
    return out


def _draw_velocity(axes: Axes, flight: Flight) -> None:
    for component, name, color in ((0, "north", "#0072B2"), (1, "east", "#CC79A7")):
        own = flight.velocity[:, component]
        tail = 0.5 * (100.0 - _SPREAD)
        low, high = np.percentile(own, [tail, 100.0 - tail], axis=1)
        axes.fill_between(flight.time, low, high, color=color, alpha=0.2, linewidth=0)
        axes.plot(
            flight.time,
            own[:, 0],
            color=color,
            linewidth=1,
            label=f"{name}, run 0; shaded: {_SPREAD:g} % of runs",
        )


def _draw_distance(axes: Axes, flight: Flight, name: str, color: str) -> None:
    distance = np.hypot(flight.position[:, 0], flight.position[:, 1]) / units.NAUTICAL_MILE
    axes.fill_between(
        flight.time,
        0.0,
        np.percentile(distance, _SPREAD, axis=1),
        color=color,
        alpha=0.2,
        linewidth=0,
    )
    axes.plot(
        flight.time,
        distance[:, 0],
        color=color,
        linewidth=1,
        label=f"{name}, run 0; shaded: {_SPREAD:g} % of runs",
    )


def numbers(study: Study) -> str:
    """JSON text of the study's numbers."""
    paper, ours, predicted = repeatability(study)
    content = {
        "nees_mean": study.nees.mean(axis=1).tolist(),
        "flights": {
            name: {
                "largest_velocity_m_per_s": float(largest_velocity(flight)[0]),
                "largest_velocity_m_per_s_p95": _high(largest_velocity(flight)),
                "largest_distance_nmi": float(largest_distance(flight)[0]),
                "largest_distance_nmi_p95": _high(largest_distance(flight)),
                "final_rms_nmi": final_rms(flight),
            }
            for name, flight in study.flights.items()
        },
        "residuals": [
            {**vars(r), "nees": r.nees if np.isfinite(r.nees) else None, "converged": converged(r)}
            for r in study.residuals
        ],
        "repeatability": {
            name: {
                "unit": UNITS[i],
                "paper": paper[i],
                "ours": ours[0, i],
                "predicted": predicted[i],
            }
            for i, name in enumerate(NAMES)
        },
    }
    return json_text(content)
