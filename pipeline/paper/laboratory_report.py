"""Text, numbers and figure of the virtual laboratory experiment."""

from itertools import takewhile
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy import special

from inscal import units
from inscal.effects import schuler_rate
from inscal.free_inertial import Flight
from inscal.parameters import COUNT, NAMES, UNITS
from pipeline.charts import style
from pipeline.config.setup import Setup
from pipeline.console.output import json_text
from pipeline.paper import claims
from pipeline.paper.claims import TEMPLATES
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
from pipeline.words.render import render, sentence

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
    return residual.failed == 0 and residual.nees <= _nees_limit(residual.runs)


def _nees_limit(runs: int) -> float:
    """Mean NEES that honest calibrations stay below."""
    return float(special.chdtri(COUNT * runs, 1.0 - _HONEST)) / runs


def judge(study: Study) -> list[Verdict]:
    """Verdicts on the calibrations and on the flight."""
    flight, perfect = study.flights[COMPENSATED], study.flights[PERFECT]
    velocity, distance = largest_velocity(flight), largest_distance(flight)
    floor = largest_distance(perfect)
    limit = _nees_limit(study.nees.size)
    out = [
        verdicts.within(
            "Table 4's unit can be calibrated from a coarse scale",
            *(float(study.nees.mean()) if np.isfinite(study.nees).all() else np.inf, limit),
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
    values = _setup(study) | _residuals(study) | _repeatability(study) | _flown(study)
    return render(TEMPLATES, "laboratory.md.jinja", claims=claims_of(study), **values)


def _setup(study: Study) -> dict[str, Any]:
    config, left = study.config, np.abs(study.truth[0])
    scale = {
        sensor: left[[NAMES.index(f"{sensor}_k{i}{i}") for i in (1, 2, 3)]].max()
        for sensor in ("gyro", "accel")
    }
    return {
        "dates": [calibration.date for calibration in TABLE_4],
        "quadratic_si": Setup(config).quadratic_unit,
        "quadratic_unit": config.sensor.quadratic_unit,
        "gyro_scale": [f"{ppm:.1f}" for ppm in TABLE_4[0].gyro_scale_ppm],
        "own": config.laboratory,
        "left": scale | {"bias": left.max()},
        "runs": study.estimate.shape[1],
        "count": COUNT,
        "passes": style.passes_text(config.estimator.passes),
        "noise": f"{config.noise.name} noise ({style.noise_text(vars(config.noise))})",
    }


def _residuals(study: Study) -> dict[str, Any]:
    groups: dict[tuple[str, int], list[Residual]] = {}
    for residual in study.residuals:
        groups.setdefault((residual.sensor, residual.passes), []).append(residual)
    rows = [
        (
            *(r.sensor, f"{r.passes}", f"{r.ppm:g}", f"{r.failed} of {r.runs}"),
            *(f"{r.nees:.1f}" if np.isfinite(r.nees) else "-", "yes" if converged(r) else "no"),
        )
        for r in study.residuals
    ]
    reaches = [
        (sensor, style.passes_text(passes), reach_text(own))
        for (sensor, passes), own in groups.items()
    ]
    return {"reaches": reaches, "residuals": rows}


def reach_text(residuals: list[Residual]) -> str:
    """Say up to which residual calibrations converge; `residuals` in ascending order."""
    good = list(takewhile(converged, residuals))
    return sentence(
        TEMPLATES,
        "reach",
        good=good[-1].ppm if good else None,
        failing=residuals[len(good)].ppm if len(good) < len(residuals) else None,
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


def _repeatability(study: Study) -> dict[str, Any]:
    paper, ours, predicted = repeatability(study)
    noise = np.abs(paper) <= _WITHIN_NOISE * predicted
    rows = [
        (
            *(md.code(NAMES[i]), UNITS[i], f"{paper[i]:.3g}", f"{ours[0, i]:.3g}"),
            *(f"{predicted[i]:.2g}", f"{abs(paper[i]) / predicted[i]:.1f}"),
        )
        for i in style.ORDER
    ]
    coarse = {f"{1.0 + 1e-6 * c:.3g}" for c in study.config.laboratory.coarse_gyro_scale_factor_ppm}
    return {
        "coarse_factor": ", ".join(sorted(coarse)),
        "spread": np.sqrt(np.square((ours - paper) / predicted).mean()),
        "within_noise": int(noise.sum()),
        "noise_sigmas": _WITHIN_NOISE,
        "drifting": [NAMES[i] for i in np.flatnonzero(~noise)],
        "differences": rows,
    }


def _flown(study: Study) -> dict[str, Any]:
    rows = [
        (
            name,
            *(f"{v:.3g}" for v in (largest_velocity(flight)[0], _high(largest_velocity(flight)))),
            *(f"{v:.3g}" for v in (largest_distance(flight)[0], _high(largest_distance(flight)))),
            f"{final_rms(flight):.3g}",
        )
        for name, flight in study.flights.items()
    ]
    floor, compensated = final_rms(study.flights[PERFECT]), final_rms(study.flights[COMPENSATED])
    return {
        "duration": study.flights[PERFECT].time[-1],
        "flights": rows,
        "share": _SPREAD,
        "compensated": compensated,
        "floor": floor,
        "little": compensated < _LITTLE * floor,
        "position": NAVIGATION_POSITION_ERROR_NMI,
        "needed": NAVIGATION_POSITION_ERROR_NMI / floor,
        "walk": study.config.noise.gyro_angle_random_walk_deg_per_sqrt_h,
        "bounds": bounds_text(_schuler_swing(study)),
    }


def bounds_text(swing: float) -> str:
    """Say whether the paper's two bounds agree; `swing` as from its velocity bound, in nmi."""
    return sentence(
        TEMPLATES,
        "navigation_bounds",
        swing=swing,
        velocity=NAVIGATION_VELOCITY_ERROR,
        position=NAVIGATION_POSITION_ERROR_NMI,
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
        "residuals": [{**vars(r), "converged": converged(r)} for r in study.residuals],
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
