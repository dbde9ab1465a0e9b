"""Arrays and numbers that the HTML page draws, taken from campaign stores."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from omegaconf.errors import OmegaConfBaseException

from inscal.experiment import run_with_history
from inscal.parameters import KIND_OF, NAMES
from pipeline.charts import density, style
from pipeline.config.load import RUN_GROUPS, config_of, load, resolved
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.console.help import choices
from pipeline.page.parts import say
from pipeline.study import campaign as campaigns
from pipeline.study import findings
from pipeline.study.campaign import Campaign

_BINS = 30
_POINTS = 250  # of a course over time
_CURVE = 61  # of a normal curve
_SAME_ESTIMATE = 1e-6  # sigmas; other processors round differently


@dataclass(frozen=True)
class Course:
    """A run over time, in paper units.

    Attributes
    ----------
    time_s : ndarray, shape (points,)
    sigma, error : ndarray, shape (passes, points, 27)
        What the filter claims, and the error of `run`. The last point is at the time of the one
        before it; in the last pass it is the estimate that counts, the prior taken once.
    covariance : ndarray, shape (27, 27)
        What the filter claims in the end.
    run : int
    as_stored : bool
        Whether the run came out as the store has it.
    """

    time_s: np.ndarray
    sigma: np.ndarray
    error: np.ndarray
    covariance: np.ndarray
    run: int
    as_stored: bool


def read_campaigns(config: Config, paths: Sequence[str | Path]) -> list[Campaign]:
    """Read campaigns, called by the names of their stores where these tell them apart.

    Parameters
    ----------
    config : Config
        Gives the bounds.
    paths : sequence of str or Path
        Campaign stores.

    Returns
    -------
    list of Campaign

    Raises
    ------
    DataError
        If a store is missing, or fewer than two runs in it are done.
    """
    every = [campaigns.read(config, path, several=True) for path in paths]
    if len({one.name for one in every}) == len(every):
        return every
    return [replace(one, name=str(one.path)) for one in every]


def config_or_reason(campaign: Campaign) -> tuple[Config | None, str]:
    """Configuration a campaign was made with; None, and why, if it is not this version's."""
    try:
        return config_of(campaign.configuration), ""
    except OmegaConfBaseException:
        return None, say("of_another_version")


def unfinished(campaign: Campaign) -> str:
    """Say that runs are missing and how to make them; nothing of a finished campaign."""
    summary, wanted = campaign.summary, campaign.configuration["campaign"]["precision"]
    values = {
        "name": campaign.name,
        "made": summary["runs_done"] + summary["runs_failed"],
        "asked": campaign.asked,
    }
    if values["made"] == campaign.asked:
        return ""
    if wanted is not None and summary["precision"] < wanted:
        values |= {"precision": summary["precision"], "least": summary["least_precise"]}
        return say("precise_enough", **values)
    return f"{say('unfinished', **values)} {command(campaign.configuration, campaign.path)}"


def units(campaign: Campaign) -> list[str]:
    """Units of the 27 parameters, to be read."""
    return [style.unit_text(kind, campaign.quadratic_unit) for kind in KIND_OF]


def command(configuration: Mapping[str, Any], path: Path) -> str:
    """Command line that makes a campaign, or the runs it lacks.

    Parameters
    ----------
    configuration : mapping
    path : Path
        Of its store.

    Returns
    -------
    str
    """
    usual = resolved(load([]))
    overrides = [f"campaign.store={path}"]
    for group in RUN_GROUPS:
        wanted = configuration[group]
        if wanted == usual[group]:
            continue
        same = [
            c for c in sorted(choices(group)) if resolved(load([f"{group}={c}"]))[group] == wanted
        ]
        overrides += [f"{group}={same[0]}"] if same else _overrides(usual[group], wanted, group)
    wanted = {key: configuration["campaign"][key] for key in ("runs", "seed", "precision")}
    overrides += _overrides(usual["campaign"], wanted, "campaign")
    return shlex.join(["python", "-m", "pipeline.simulate", *overrides])


def _overrides(usual: Mapping[str, Any], wanted: Mapping[str, Any], prefix: str) -> list[str]:
    lines = []
    for key, value in wanted.items():
        name, other = f"{prefix}.{key}", usual.get(key)
        if isinstance(value, Mapping) and isinstance(other, Mapping):
            lines += _overrides(other, value, name)
        elif value != other:
            shown = "null" if value is None else str(value).replace("'", "").replace(" ", "")
            lines.append(f"{name}={shown}")
    return lines


def course_of(campaign: Campaign, config: Config) -> Course:
    """Repeat the first run done of a campaign and keep a few hundred points of its course.

    Parameters
    ----------
    campaign : Campaign
    config : Config
        That it was made with.

    Returns
    -------
    Course
    """
    setup = Setup(config)
    experiment, unit = setup.experiment, setup.unit
    number = int(campaign.runs["run"][0])
    outcome, history = run_with_history(experiment, number)
    updates = experiment.motion.updates
    points = np.unique(np.linspace(0, updates - 1, min(updates, _POINTS)).round().astype(int))
    stored = campaign.runs["estimate"].transpose("run", "parameter").to_numpy()[0]
    final, claimed = outcome.estimate[0], experiment.estimator.predicted_std / unit
    sigma = np.array(
        [
            experiment.estimator.gains(number).parameter_std[points] / unit
            for number in range(len(history.estimate))
        ]
    )
    error = (history.estimate[..., 0][:, points] - outcome.truth[0]) / unit
    tolerance = _SAME_ESTIMATE * np.where(claimed > 0.0, claimed, 1.0)
    return Course(
        time_s=np.append(points + 1, updates) * config.estimator.update_interval_s,
        sigma=_ending(sigma, claimed),
        error=_ending(error, (final - outcome.truth[0]) / unit),
        covariance=experiment.estimator.parameter_covariance / np.outer(unit, unit),
        run=number,
        as_stored=bool((np.abs(final / unit - stored) < tolerance).all()),
    )


def _ending(course: np.ndarray, final: np.ndarray) -> np.ndarray:
    """Courses with one more point: what becomes of the last pass when the prior counts once."""
    last = np.concatenate([course[:-1, -1:], final[None, None]])
    return np.concatenate([course, last], axis=1)


def rounded(value: float, digits: int = 4) -> float | None:
    """Number with few digits, for a smaller page; None where there is none."""
    return float(f"{value:.{digits}g}") if np.isfinite(value) else None


def distribution(campaign: Campaign, index: int) -> dict[str, Any]:
    """Histogram of a parameter's errors, and the normal curve that the filter predicts.

    Parameters
    ----------
    campaign : Campaign
    index : int
        Of the parameter.

    Returns
    -------
    dict
        ``view`` (half-width of the picture), ``bound``, ``bars`` and ``curve``, the latter two
        as rows for a chart.
    """
    error, sigma = campaign.error[:, index], float(campaign.predicted_std[index])
    bound = campaign.summary["parameters"][NAMES[index]]["bound"]
    view = 1.05 * max(float(np.abs(error).max()), 4.0 * sigma)
    if bound < 1.5 * view:
        view = max(view, 1.08 * bound)
    edges = np.linspace(-view, view, _BINS + 1)
    bars = [bar for bar in _bars(error, edges) if bar["runs"]]
    curve: list[dict[str, Any]] = []
    if sigma > 0.0:
        x = np.linspace(-min(view, 4.5 * sigma), min(view, 4.5 * sigma), _CURVE)
        y = len(error) * (edges[1] - edges[0]) * density.normal(x, sigma)
        curve = [{"error": rounded(a), "runs": rounded(b)} for a, b in zip(x, y, strict=True)]
    return {"view": rounded(view), "bound": bound, "bars": bars, "curve": curve}


def _bars(values: np.ndarray, edges: np.ndarray) -> list[dict[str, Any]]:
    count, _ = np.histogram(values, edges)
    return [
        {"from": rounded(left), "to": rounded(right), "runs": int(n)}
        for left, right, n in zip(edges[:-1], edges[1:], count, strict=True)
    ]


def correlations(campaign: Campaign, covariance: np.ndarray | None) -> list[list[dict[str, Any]]]:
    """Correlation of each parameter's errors with those of the others, strongest first.

    Parameters
    ----------
    campaign : Campaign
    covariance : ndarray, shape (27, 27), or None
        What the filter claims.

    Returns
    -------
    list of list of dict
        Rows for a chart, by parameter: ``other``, ``errors`` and, where claimed, ``filter``.
    """
    with np.errstate(invalid="ignore"):  # a parameter that never errs has none
        found = np.corrcoef(campaign.error, rowvar=False)
        std = np.sqrt(np.diag(covariance)) if covariance is not None else np.zeros(len(NAMES))
        claimed = (covariance if covariance is not None else 0.0) / np.outer(std, std)
    out = []
    for own in range(len(NAMES)):
        rows: list[dict[str, Any]] = [
            {
                "other": NAMES[other],
                "errors": rounded(found[own, other], 3),
                "filter": rounded(claimed[own, other], 3),
            }
            for other in range(len(NAMES))
            if other != own
        ]
        out.append(sorted(rows, key=lambda row: -abs(row["errors"] or 0.0)))
    return out


def nees_histogram(campaign: Campaign) -> dict[str, Any]:
    """Histogram of the NEES against the chi-square curve of an honest filter.

    Parameters
    ----------
    campaign : Campaign

    Returns
    -------
    dict
        ``bars``, ``curve`` (rows for a chart), ``beyond`` (runs right of the picture) and
        ``view``.
    """
    values, dof = campaign.runs["nees"].to_numpy(), findings.degrees_of_freedom(campaign.summary)
    view = 4.0 * max(dof, 1)
    edges = np.linspace(0.0, view, 2 * _BINS + 1)
    x = np.linspace(0.0, view, 2 * _CURVE)
    y = len(values) * (edges[1] - edges[0]) * density.chi_square(x, dof)
    return {
        "bars": _bars(values, edges),
        "curve": [{"nees": rounded(a), "runs": rounded(b)} for a, b in zip(x, y, strict=True)],
        "beyond": int((values > view).sum()),
        "view": view,
    }
