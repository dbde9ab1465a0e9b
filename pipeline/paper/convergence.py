"""When the paper's parameters settle (Figs. 3 and 4), in many runs instead of one."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from inscal.calibrator import empty_history
from inscal.experiment import Experiment, tiles
from inscal.parameters import INDEX, NAMES, UNITS
from pipeline.charts import style
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.console.errors import ConfigError
from pipeline.console.output import json_text
from pipeline.paper import claims
from pipeline.paper import values as paper_values
from pipeline.paper.claims import TEMPLATES
from pipeline.study import verdict as verdicts
from pipeline.study.verdict import Verdict
from pipeline.words import markdown as md
from pipeline.words.render import render, sentence

QUADRATIC, LEVER_ARM = "accel_quadratic", "lever_arm"
GROUPS = (QUADRATIC, LEVER_ARM)

_EVERY = 20  # updates from one point of a curve to the next
_SHARE = 95.0  # per cent of runs that have to be settled
_EARLY_S = 500.0  # before the claimed time still counts as about that time
_RUN_COLOR, _BAND_COLOR = style.NOISE_COLORS["noisy"], style.NOISE_COLORS["reference"]


@dataclass(frozen=True)
class Study:
    """Courses of the parameters of `GROUPS`, in paper units.

    Attributes
    ----------
    time : ndarray, shape (points,)
        s.
    error : dict of str to ndarray, shape (points, 3, runs)
        Estimate minus truth, by group.
    sigma : dict of str to ndarray, shape (points, 3)
        The filter's own.
    bound : dict of str to ndarray, shape (3,)
        Accuracy bounds.
    failed : int
        Runs left out because they diverged.
    """

    config: Config
    time: np.ndarray
    error: dict[str, np.ndarray]
    sigma: dict[str, np.ndarray]
    bound: dict[str, np.ndarray]
    failed: int

    @property
    def duration(self) -> float:
        """Length of the path, s."""
        return float(self.time[-1])

    @property
    def last_turns(self) -> float:
        """When the stretch begins in which the paper's lever arm settles, s."""
        return self.duration - paper_values.LEVER_ARM_SETTLES_WITHIN_LAST_S


def first_pass_errors(experiment: Experiment, runs: int, every: int) -> np.ndarray:
    """Errors over the first pass, at every so many updates, shape (points, 27, runs), SI."""
    updates = experiment.motion.updates
    history = empty_history(1, updates)
    out = np.empty((updates // every, len(NAMES), runs))
    for part, truth, _ in tiles(experiment, range(runs), history=history):
        course = history.estimate[0, every - 1 :: every, :, : len(truth)]
        out[:, :, part] = course - truth.T
    return out


def study_of(config: Config) -> Study:
    """Run the calibrations of the configuration and keep their courses.

    Raises
    ------
    ConfigError
        If the estimator has more than one pass: the later ones would have no course.
    """
    if config.estimator.passes != 1:
        raise ConfigError(f"estimator.passes = {config.estimator.passes}: must be 1 in this stage")
    setup = Setup(config)
    experiment, unit, bound = setup.experiment, setup.unit, setup.bound
    error = first_pass_errors(experiment, config.campaign.runs, _EVERY) / unit[:, None]
    good = np.isfinite(error).all(axis=(0, 1))
    sigma = experiment.estimator.first.parameter_std[_EVERY - 1 :: _EVERY] / unit
    interval = _EVERY * config.estimator.update_interval_s
    return Study(
        config=config,
        time=interval * np.arange(1, len(error) + 1),
        error={group: error[:, INDEX[group]][..., good] for group in GROUPS},
        sigma={group: sigma[:, INDEX[group]] for group in GROUPS},
        bound={group: bound[INDEX[group]] for group in GROUPS},
        failed=int((~good).sum()),
    )


def settled_at(time: np.ndarray, size: np.ndarray, limit: float) -> float:
    """Time from which on something stays within a limit; infinite if it ends outside.

    Parameters
    ----------
    time, size : ndarray, shape (points,)
    limit : float

    Returns
    -------
    float
        Time of the first point of the stretch at the end that is wholly within the limit.
    """
    outside = np.flatnonzero(size > limit)
    if not len(outside):
        return float(time[0])
    return float(time[outside[-1] + 1]) if outside[-1] + 1 < len(time) else np.inf


def settling(study: Study, group: str) -> list[float]:
    """When `_SHARE` per cent of runs keep the bound for good, of each axis, s."""
    size = np.percentile(np.abs(study.error[group]), _SHARE, axis=2)
    return [settled_at(study.time, size[:, i], study.bound[group][i]) for i in range(3)]


def judge(study: Study) -> list[Verdict]:
    """Verdicts on the two claims of when errors settle."""
    quadratic, lever = settling(study, QUADRATIC), settling(study, LEVER_ARM)
    latest = paper_values.QUADRATIC_SETTLED_S
    start = study.last_turns
    return [
        verdicts.within(
            f"the quadratic terms have settled by about {latest:g} s",
            max(quadratic),
            latest + _EARLY_S,
            f"{_times(quadratic)} (x, y, z)",
        ),
        verdicts.judged(
            f"the lever arm settles in the last {study.duration - start:g} s, from {start:g} s on",
            f"{_times(lever)} (x, y, z)",
            all(start - _EARLY_S <= t <= study.duration for t in lever),
        ),
    ]


def _times(times: list[float]) -> str:
    return md.listed(f"{t:.0f} s" if np.isfinite(t) else "never" for t in times)


def claims_of(study: Study) -> claims.Page:
    """Give the verdicts as the claims of the page."""
    return claims.page_of(
        "How the quadratic terms and the lever arm settle (Figs. 3 and 4)", judge(study)
    )


def text(study: Study) -> str:
    """Compose the report in Markdown."""
    config = study.config
    rows = [
        (md.code(NAMES[INDEX[group]][i]), *_row(study, group, i))
        for group in GROUPS
        for i in range(3)
    ]
    return render(
        TEMPLATES,
        "convergence.md.jinja",
        claims=claims_of(study),
        schedule=style.schedule_text({"schedule": vars(config.schedule)}),
        passes=style.passes_text(config.estimator.passes),
        runs=study.error[QUADRATIC].shape[2],
        truth=config.truth.distribution,
        failed=study.failed,
        noise=f"{config.noise.name} noise ({style.noise_text(vars(config.noise))})",
        share=_SHARE,
        rows=rows,
        start=study.last_turns,
        duration=study.duration,
        lever_arm=lever_arm_text(study),
    )


def _row(study: Study, group: str, axis: int) -> tuple[str, ...]:
    sigma, bound = study.sigma[group][:, axis], study.bound[group][axis]
    before, after = rmse_around_last_turns(study, group)
    return (
        UNITS[INDEX[group]][axis],
        f"{bound:g}",
        _times([settling(study, group)[axis]]),
        _times([settled_at(study.time, 3.0 * sigma, bound)]),
        f"{before[axis]:.3g}",
        f"{after[axis]:.3g}",
        f"{sigma[-1]:.3g}",
    )


def rmse_around_last_turns(study: Study, group: str) -> tuple[np.ndarray, np.ndarray]:
    """RMSE of the three axes before the stretch in which the paper's lever arm settles, and after.

    Returns
    -------
    before, after : ndarray, shape (3,)
    """
    rmse = np.sqrt(np.square(study.error[group]).mean(axis=2))
    return rmse[np.searchsorted(study.time, study.last_turns + 1e-6) - 1], rmse[-1]


def lever_arm_text(study: Study) -> str:
    """Say what the last turns are to the lever arm here."""
    before, after = rmse_around_last_turns(study, LEVER_ARM)
    return sentence(
        TEMPLATES,
        "lever_arm",
        first=max(settling(study, LEVER_ARM)),
        start=study.last_turns,
        last=study.duration - study.last_turns,
        gain=float(np.sqrt(np.mean(np.square(before)) / np.mean(np.square(after)))),
    )


@style.styled
def figure(study: Study) -> Figure:
    """Errors over time: one run, the percentiles of all, and the filter's own 3 sigma."""
    out = Figure(figsize=(11, 7))
    panels = out.subplots(len(GROUPS), 3, sharex=True)
    for row, group in zip(panels, GROUPS, strict=True):
        for axis, axes in enumerate(row):
            _draw(axes, study, group, axis)
    for axes in panels[-1]:
        axes.set_xlabel("time, s")
    runs = study.error[QUADRATIC].shape[2]
    handles = [
        style.handle("run 0", color=_RUN_COLOR),
        style.handle(f"{_SHARE:g} % of {runs} runs", color=_BAND_COLOR, linewidth=6, alpha=0.35),
        style.handle("filter's own ±3 sigma", color=style.PREDICTION_COLOR),
        style.handle("paper's bound", color=style.LIMIT_COLOR, linestyle="--", linewidth=1),
        style.handle("when the paper's settle", color=style.LIMIT_COLOR, linestyle=":"),
    ]
    out.legend(handles=handles, loc="outside lower center", ncols=5)
    out.suptitle(
        "Estimation errors over the path, first pass (view limited to 5 bounds)\n"
        f"{study.config.noise.name} noise: {style.noise_text(vars(study.config.noise))}"
    )
    return out


def _draw(axes: Axes, study: Study, group: str, axis: int) -> None:
    error, bound = study.error[group][:, axis], float(study.bound[group][axis])
    tail = 0.5 * (100.0 - _SHARE)
    low, high = np.percentile(error, [tail, 100.0 - tail], axis=1)
    axes.fill_between(study.time, low, high, color=_BAND_COLOR, alpha=0.35, linewidth=0)
    axes.plot(study.time, error[:, 0], color=_RUN_COLOR, linewidth=1)
    for sign in (-1.0, 1.0):
        envelope = sign * 3.0 * study.sigma[group][:, axis]
        axes.plot(study.time, envelope, color=style.PREDICTION_COLOR, linewidth=1)
        axes.axhline(sign * bound, color=style.LIMIT_COLOR, linestyle="--", linewidth=1)
    settles = paper_values.QUADRATIC_SETTLED_S if group == QUADRATIC else study.last_turns
    axes.axvline(settles, color=style.LIMIT_COLOR, linestyle=":")
    axes.set_ylim(-5.0 * bound, 5.0 * bound)
    unit = style.unit_text(group, study.config.sensor.quadratic_unit)
    axes.set_title(f"{style.label(INDEX[group].start + axis)}")
    axes.set_ylabel(f"estimate minus truth, {unit}")


def numbers(study: Study) -> str:
    """JSON text of the settling times (infinite: never) and errors, in paper units."""
    content = {
        group: {
            "settled_s": settling(study, group),
            "final_rmse": rmse_around_last_turns(study, group)[1].tolist(),
            "final_sigma": study.sigma[group][-1].tolist(),
        }
        for group in GROUPS
    }
    return json_text(content)
