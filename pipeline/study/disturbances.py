"""Disturbances one by one: campaigns with each alone, and what the error budget says of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from inscal.parameters import NAMES
from pipeline.campaign import judged
from pipeline.config.disturbance import IDLE, KEYS, size_of
from pipeline.config.load import disturbances, resolved, undisturbed
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.console.errors import ConfigError
from pipeline.study import findings
from pipeline.study.budget import Sheet, sheet
from pipeline.study.honesty import nees_limits
from pipeline.words import markdown as md
from pipeline.words.render import render

_TEMPLATES = Path(__file__).parent / "templates"
NONE, ALL = "none", "all"
"""Names of the campaigns without disturbances, and with all of them."""
ALLOWED = 3.0
"""Standard errors that the RMSE of a parameter may lie from its budget."""
_ENDS = ("", "_lower", "_upper")
_FACTOR = "_noise_factor"
_CALLED = {"observation_correlation_time_s": "observation_correlation"}  # has no size that scales


@dataclass(frozen=True)
class Plan:
    """A campaign with one disturbance, with none or with all.

    Attributes
    ----------
    name : str
        Key of the disturbance, `NONE` or `ALL`.
    size : float or None
        Its size there; None of `NONE` and `ALL`.
    config : Config
        With a store of its own.
    """

    name: str
    size: float | None
    config: Config


def plans(config: Config) -> list[Plan]:
    """Campaigns that show what each disturbance of a configuration does.

    Parameters
    ----------
    config : Config

    Returns
    -------
    list of Plan

    Raises
    ------
    ConfigError
        If there is no disturbance.
    """
    keys = disturbances(resolved(config))
    if not keys:
        raise ConfigError(
            f"disturbance = {config.disturbance.name}: has no disturbance; choose one that has, "
            "such as disturbance=laboratory"
        )
    sizes = {key: getattr(config.disturbance, key) for key in keys}
    if config.growth is not None:
        alone = _alone(config, sizes)
        sizes = {key: grown(alone[key], key, sizes[key], config.growth) for key in keys}
    return [
        Plan(NONE, None, _with(config, NONE, {})),
        *(Plan(key, size, _with(config, key, {key: size})) for key, size in sizes.items()),
        Plan(ALL, None, _with(config, ALL, sizes)),
    ]


def _with(config: Config, name: str, sizes: Mapping[str, Any]) -> Config:
    about = {key: undisturbed()[key] for key in KEYS if key not in IDLE} | dict(sizes)
    return replace(
        config,
        disturbance=replace(config.disturbance, name=name, **about),
        campaign=replace(config.campaign, store=f"{config.campaign.store}/{name}"),
    )


def _alone(config: Config, sizes: Mapping[str, float]) -> dict[str, Sheet]:
    """Budgets with each disturbance alone.

    One has them all, but for what correlated noise does, which depends on how large the noise is.
    """
    out: dict[str, Sheet] = {}
    for of_noise in (False, True):
        some = {k: size for k, size in sizes.items() if k.endswith(_FACTOR) == of_noise}
        every = sheet(Setup(_with(config, ALL, some)))
        out |= {key: every.alone(_source(key)) for key in some}
    return out


def _source(key: str) -> str:
    """What a budget calls the disturbance of a key."""
    return _CALLED.get(key, size_of(key)[0])


def grown(alone: Sheet, key: str, size: float, growth: float) -> float:
    """Size at which one disturbance lets the RMSE of its worst parameter grow by a factor.

    Parameters
    ----------
    alone : Sheet
        Budget with nothing but this disturbance.
    key : str
        Its key.
    size : float
        Its size there.
    growth : float
        Above one.

    Returns
    -------
    float
        `size` as it is where the disturbance does nothing, or has no size that scales.
    """
    source = _source(key)
    room = alone.room(source, growth)[0] if source in alone.variance else np.inf
    if key in _CALLED or not np.isfinite(room):
        return size
    if key.endswith(_FACTOR):  # adds by its square less one
        return float(np.sqrt(1.0 + room * (size**2 - 1.0)))
    return float(size * np.sqrt(room))


def content(config: Config, planned: Sequence[Plan]) -> dict[str, Any]:
    """What campaigns and budget say, as it is written.

    Parameters
    ----------
    config : Config
    planned : sequence of Plan
        Whose campaigns are made.

    Returns
    -------
    dict
    """
    alone = _alone(config, {plan.name: plan.size for plan in planned if plan.size is not None})
    every = sheet(Setup(planned[-1].config))
    made = alone | {NONE: every.alone(), ALL: every}
    rows = [_row(plan, made[plan.name]) for plan in planned]
    runs = config.campaign.runs
    return {
        "schedule": config.schedule.name,
        "noise": config.noise.name,
        "disturbance": config.disturbance.name,
        "runs": runs,
        "seed": config.campaign.seed,
        "growth": config.growth,
        "nees_limits": nees_limits(runs, rows[0]["modelled"]),
        "campaigns": rows,
    }


def _row(plan: Plan, made: Sheet) -> dict[str, Any]:
    found = judged.summary_of(plan.config, plan.config.campaign.store)
    modelled = np.flatnonzero(made.formal_std > 0.0)
    runs = int(found.runs_done)
    ratio = (found.rmse.to_numpy() / made.true_std)[modelled]
    worst = int(modelled[np.argmax((made.true_std / made.formal_std)[modelled])])
    far = int(np.argmax(np.abs(ratio - 1.0)))
    return {
        "name": plan.name,
        "size": plan.size,
        "modelled": len(modelled),
        "runs_done": runs,
        "runs_failed": int(found.runs_failed),
        "nees": float(found.nees_mean),
        "expected_nees": made.budget.expected_nees,
        "worst": NAMES[worst],
        "worst_rmse_over_formal": float(found.rmse[worst]) / made.formal_std[worst],
        "worst_true_over_formal": made.true_std[worst] / made.formal_std[worst],
        "farthest": NAMES[modelled[far]],
        "farthest_rmse_over_budget": float(ratio[far]),
        # of a root mean square of so many normal errors
        "farthest_standard_errors": float((ratio[far] - 1.0) * np.sqrt(2.0 * runs)),
        **{f"joint_share{end}": float(found[f"joint_share{end}"]) for end in _ENDS},
    }


def page(found: Mapping[str, Any]) -> str:
    """Write the page of what was found.

    Parameters
    ----------
    found : mapping
        Of `content`.

    Returns
    -------
    str
    """
    rows = found["campaigns"]
    first, *alone, last = rows
    alone = sorted(alone, key=lambda row: -row["nees"])
    within = [row for row in alone if abs(row["farthest_standard_errors"]) <= ALLOWED]
    return render(
        _TEMPLATES,
        "disturbances.md.jinja",
        **{key: found[key] for key in found if key != "campaigns"},
        table_rows=[_cells(row) for row in (first, *alone, last)],
        alone=alone,
        undisturbed=first,
        together=last,
        allowed=ALLOWED,
        within=within,
        beyond=[row["name"] for row in alone if row not in within],
        joint={row["name"]: findings.joint_text(row) for row in (first, last)},
    )


def _cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    return (
        row["name"] if row["size"] is None else md.code(row["name"]),
        "" if row["size"] is None else f"{row['size']:.3g}",
        f"{row['nees']:.4g}",
        f"{row['expected_nees']:.4g}",
        md.code(row["worst"]),
        f"{row['worst_rmse_over_formal']:.2f}",
        f"{row['worst_true_over_formal']:.2f}",
        findings.joint_text(row),
        f"{row['farthest_rmse_over_budget']:.3f}",
        f"{row['farthest_standard_errors']:+.1f}",
    )
