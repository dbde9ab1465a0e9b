"""Disturbances one by one: campaigns with each alone, and what the error budget says of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from inscal.parameters import NAMES
from inscal.statistics import nominal_coverage
from pipeline.campaign import judged, store
from pipeline.config.disturbance import size_of
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.study import findings
from pipeline.study.budget import Sheet, sheet
from pipeline.study.honesty import nees_limits
from pipeline.study.truths import disturbed_by, with_truth
from pipeline.words import markdown as md
from pipeline.words.render import render

_TEMPLATES = Path(__file__).parent / "templates"
NONE, ALL = "none", "all"
"""Names of the campaigns without disturbances, and with all of them."""
ALLOWED = 3.0
"""Standard errors that the RMSE of a parameter may lie from its budget."""
_ENDS = ("", "_lower", "_upper")
SECOND_ORDER = 1e-3
"""Share of a variance that linear theory is not asked for."""
MANY = 0.01
"""Share of failed runs beyond which a disturbance is too large for linear theory."""
_NO_RUN = "no run"
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
    sizes = disturbed_by(config)
    if config.growth is not None:
        alone = _alone(config, sizes)
        sizes = {key: grown(alone[key], key, size, config.growth) for key, size in sizes.items()}
    return [
        Plan(NONE, None, with_truth(config, NONE, {}, NONE)),
        *(
            Plan(key, size, with_truth(config, key, {key: size}, key))
            for key, size in sizes.items()
        ),
        Plan(ALL, None, with_truth(config, ALL, sizes, ALL)),
    ]


def _alone(config: Config, sizes: Mapping[str, float]) -> dict[str, Sheet]:
    """Budgets with each disturbance alone.

    One has them all, but for what correlated noise does, which depends on how large the noise is.
    """
    out: dict[str, Sheet] = {}
    for of_noise in (False, True):
        some = {k: size for k, size in sizes.items() if k.endswith(_FACTOR) == of_noise}
        every = sheet(Setup(with_truth(config, ALL, some, ALL)))
        out |= {key: every.alone(_source(key)) for key in some}
    return out


def _source(key: str) -> str:
    """What a budget calls the disturbance of a key."""
    return _CALLED.get(key, size_of(key)[0])


def grown(alone: Sheet, key: str, size: float, growth: float | str) -> float:
    """Size at which one disturbance lets the RMSE of a parameter grow by a factor, or to its bound.

    Parameters
    ----------
    alone : Sheet
        Budget with nothing but this disturbance.
    key : str
        Its key.
    size : float
        Its size there.
    growth : float or str
        Of `Sheet.room`.

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
    base = store.read(planned[0].config.campaign.store)
    rows = [_row(plan, made[plan.name], base) for plan in planned]
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


def _row(plan: Plan, made: Sheet, base: xr.Dataset) -> dict[str, Any]:
    modelled = np.flatnonzero(made.formal_std > 0.0)
    worst = made.most_disturbed
    first = int(modelled[np.argmin((made.bound / made.true_std)[modelled])])
    row = {
        "name": plan.name,
        "size": plan.size,
        "modelled": len(modelled),
        "expected_nees": made.budget.expected_nees,
        "worst": NAMES[worst],
        "worst_true_over_formal": made.true_std[worst] / made.formal_std[worst],
        "first_beyond": NAMES[first],
        "first_beyond_expected": nominal_coverage(made.bound[first] / made.true_std[first]),
    }
    campaign = store.read(plan.config.campaign.store)
    failed = int((campaign.status == store.FAILED).sum())
    if failed == campaign.sizes["run"]:
        return row | {"runs_done": 0, "runs_failed": failed}
    found = judged.summary(plan.config, plan.config.campaign.store, campaign)
    runs = int(found.runs_done)
    ratio = (found.rmse.to_numpy() / made.true_std)[modelled]
    # of a root mean square of so many normal errors
    apart = (ratio - 1.0) * np.sqrt(2.0 * runs)
    far, paired = int(np.argmax(np.abs(apart))), _paired(campaign, base, made)[modelled]
    off = np.minimum(np.abs(apart), np.abs(paired)) > ALLOWED
    within = found.isel(parameter=first)
    return row | {
        "runs_done": runs,
        "runs_failed": failed,
        "nees": float(found.nees_mean),
        "worst_rmse_over_formal": float(found.rmse[worst]) / made.formal_std[worst],
        "farthest": NAMES[modelled[far]],
        "farthest_rmse_over_budget": float(ratio[far]),
        "farthest_standard_errors": float(apart[far]),
        "farthest_paired_standard_errors": float(paired[far]),
        "off": [NAMES[place] for place in modelled[off]],
        **{f"joint_share{end}": float(found[f"joint_share{end}"]) for end in _ENDS},
        **{f"first_beyond_share{end}": float(within[f"share_within_bound{end}"]) for end in _ENDS},
    }


def _paired(campaign: xr.Dataset, base: xr.Dataset, made: Sheet) -> np.ndarray:
    """What a disturbance adds to the mean squared errors, less what the budget adds.

    In standard errors of the pairs of runs, which share all other draws. What is below
    `SECOND_ORDER` of the variance is no difference.
    """
    both = (campaign.status == store.DONE) & (base.status == store.DONE)
    squared = [np.square(one.error.to_numpy()[both.to_numpy()]) for one in (campaign, base)]
    change = (squared[0] - squared[1]) / made.true_std**2
    expected = 1.0 - (made.formal_std / made.true_std) ** 2
    error = np.hypot(change.std(axis=0) / np.sqrt(len(change)), SECOND_ORDER)
    return np.asarray((change.mean(axis=0) - expected) / error)


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
    alone = sorted(alone, key=lambda row: -row.get("nees", np.inf))
    broken = [row for row in alone if row["runs_failed"] > MANY * found["runs"]]
    linear = [row for row in alone if row not in broken]
    within = [row for row in linear if not row["off"]]
    return render(
        _TEMPLATES,
        "disturbances.md.jinja",
        **{key: found[key] for key in found if key != "campaigns"},
        broken_rows=[_cells_of_effect(row) for row in (first, *alone, last)],
        held_rows=[_cells_of_budget(row) for row in (first, *alone, last)],
        linear=linear,
        broken=[(row["name"], row["runs_failed"]) for row in broken],
        enough=findings.ENOUGH,
        undisturbed=first,
        together=last,
        allowed=ALLOWED,
        within=within,
        beyond=[(row["name"], row["off"]) for row in linear if row["off"]],
        joint={row["name"]: _joint(row) for row in (first, last)},
    )


def _called(row: Mapping[str, Any]) -> str:
    return str(row["name"] if row["size"] is None else md.code(row["name"]))


def _cells_of_effect(row: Mapping[str, Any]) -> tuple[str, ...]:
    return (
        _called(row),
        "" if row["size"] is None else f"{row['size']:.3g}",
        _found(row, "nees", ".4g"),
        f"{row['expected_nees']:.4g}",
        md.code(row["worst"]),
        _found(row, "worst_rmse_over_formal", ".2f"),
        f"{row['worst_true_over_formal']:.2f}",
        _joint(row),
    )


def _cells_of_budget(row: Mapping[str, Any]) -> tuple[str, ...]:
    some = bool(row["runs_done"])
    return (
        _called(row),
        md.code(row["first_beyond"]),
        md.share(*(row[f"first_beyond_share{end}"] for end in _ENDS)) if some else _NO_RUN,
        md.percent(row["first_beyond_expected"]),
        md.code(row["farthest"]) if some else _NO_RUN,
        _found(row, "farthest_rmse_over_budget", ".3f"),
        _found(row, "farthest_standard_errors", "+.1f"),
        _found(row, "farthest_paired_standard_errors", "+.1f"),
    )


def _found(row: Mapping[str, Any], key: str, form: str) -> str:
    return format(row[key], form) if row["runs_done"] else _NO_RUN


def _joint(row: Mapping[str, Any]) -> str:
    return findings.joint_text(row) if row["runs_done"] else "0 %: every run fails"
