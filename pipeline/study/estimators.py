"""Filters with augmented states: what they stand, and what they cost where there is nothing."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from inscal.parameters import AUGMENTATIONS, GROUPS, NAMES, UNITS
from pipeline.campaign import judged
from pipeline.config.disturbance import BELIEVED, key_of
from pipeline.config.load import load, resolved, unknown
from pipeline.config.schema import Config, Estimator
from pipeline.config.setup import Setup
from pipeline.console.output import json_data
from pipeline.study import findings, honesty
from pipeline.study.budget import sheet
from pipeline.study.truths import disturbed_by, with_truth
from pipeline.study.unseen import OBLIQUE
from pipeline.words import markdown as md
from pipeline.words.render import render

_TEMPLATES = Path(__file__).parent / "templates"
PAPER = "states36"
"""The filter that others are held against."""
NAMED = (PAPER, "states43", "robust")
"""Choices of the group `estimator` that are compared."""
APART = ("accel_cubic", "accel_asymmetry")
"""Groups that paths along the axes mix up with parameters, and turns of 45 degrees tell apart."""
BOTH = "_and_".join(APART)
"""What the filter that estimates them all is called."""
_SHARED = (*("accel_k11", "accel_k22", "accel_k33"), *GROUPS["accel_quadratic"])
NOTHING, OWN, LABORATORY = "none", "what it models", "all"
"""Kinds of truth: without disturbances, with those modelled, with those configured."""


@dataclass(frozen=True)
class Plan:
    """A campaign.

    Attributes
    ----------
    filter : str
        Name of the estimator, or of the one group that the 36 states have beside them.
    truth : str
        `NOTHING`, `OWN` or `LABORATORY`.
    config : Config
        With a store of its own.
    """

    filter: str
    truth: str
    config: Config


def plans(config: Config) -> list[Plan]:
    """Campaigns of every group alone, of the named filters, and of the paper's.

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
    named = {name: _named(name) for name in NAMED}
    alone = {
        group: replace(named[PAPER], states=[*GROUPS, group], believed=named[PAPER].believed)
        for group in AUGMENTATIONS
    }
    out = [_plan(config, group, OWN, about, sizes) for group, about in alone.items()]
    for name, about in named.items():
        kinds = (NOTHING, OWN, LABORATORY) if name != PAPER else (NOTHING, LABORATORY)
        out += [_plan(config, name, kind, about, sizes) for kind in kinds]
    both = replace(named[PAPER], states=[*GROUPS, *APART])
    oblique = replace(config, schedule=load([f"schedule={OBLIQUE}"]).schedule)
    for path in (config, oblique):
        out.append(_plan(path, f"{BOTH}-{path.schedule.name}", OWN, both, sizes))
    return out


@cache
def _named(name: str) -> Estimator:
    return load([f"estimator={name}"]).estimator


def _truth(about: Estimator, kind: str, every: Mapping[str, float]) -> dict[str, Any]:
    """Sizes of the disturbances that a kind of truth has."""
    if kind != OWN:
        return dict(every) if kind == LABORATORY else {}
    own = {AUGMENTATIONS[group].source for group in about.states if group in AUGMENTATIONS}
    keys = {key_of(source) for source in own} | {f"{source}_time_s" for source in own}
    keys |= {key for key in BELIEVED if key.endswith("_noise_factor")}
    return {key: getattr(about.believed, key) for key in keys & set(BELIEVED)}


def _plan(config: Config, name: str, kind: str, about: Estimator, sizes: Mapping) -> Plan:
    called, truth = kind.replace(" ", "_"), _truth(about, kind, sizes)
    made = with_truth(replace(config, estimator=about), called, truth, f"{name}-{called}")
    return Plan(name, kind, made)


def content(config: Config, planned: Sequence[Plan]) -> dict[str, Any]:
    """What the campaigns say, as it is written.

    Parameters
    ----------
    config : Config
    planned : sequence of Plan
        Whose campaigns are made.

    Returns
    -------
    dict
    """
    by_truth = {(plan.filter, plan.truth): plan for plan in planned}
    base = by_truth[PAPER, NOTHING].config.campaign.store
    runs = config.campaign.runs
    separated = [plan for plan in planned if plan.filter.startswith(BOTH)]
    return {
        "schedule": config.schedule.name,
        "noise": config.noise.name,
        "disturbance": config.disturbance.name,
        "runs": runs,
        "seed": config.campaign.seed,
        "nees_limits": honesty.nees_limits(runs, len(NAMES)),
        "ratio_limits": honesty.ratio_limits(runs, len(NAMES)),
        "campaigns": [_row(plan) for plan in planned if plan not in separated],
        "separated": [_separated(plan) for plan in separated],
        "price": {
            plan.filter: _price(plan.config.campaign.store, base)
            for plan in planned
            if plan.truth == NOTHING and plan.filter != PAPER
        },
    }


def _row(plan: Plan) -> dict[str, Any]:
    setup = Setup(plan.config)
    found = json_data(judged.as_json(judged.summary_of(plan.config, plan.config.campaign.store)))
    ratios = honesty.ratios(found)
    low, high = min(ratios, key=ratios.__getitem__), max(ratios, key=ratios.__getitem__)
    made = sheet(setup)
    formal = made.true_std[made.formal_std > 0.0] / made.formal_std[made.formal_std > 0.0]
    return {
        "filter": plan.filter,
        "truth": plan.truth,
        "states": setup.model.states,
        "unknown": unknown(resolved(plan.config)),
        "nees": found["nees_mean"],
        "expected_nees": made.budget.expected_nees,
        "nees_of_36": _nees_of_36(plan.config) if plan.truth == OWN else None,
        "true_over_formal": [float(formal.min()), float(formal.max())],
        "least": [low, ratios[low]],
        "most": [high, ratios[high]],
        "runs_done": found["runs_done"],
        "runs_failed": found["runs_failed"],
        **{key: found[key] for key in ("joint_share", "joint_share_lower", "joint_share_upper")},
        "augmented": {
            name: row["rmse_over_predicted"] for name, row in found.get("augmented", {}).items()
        },
    }


def _nees_of_36(config: Config) -> float:
    """NEES that the paper's filter would have, by its budget."""
    paper = replace(config, estimator=_named(PAPER))
    return float(sheet(Setup(paper)).budget.expected_nees)


def _separated(plan: Plan) -> dict[str, Any]:
    """What becomes of parameters that others are mixed up with, on one path."""
    found = json_data(judged.as_json(judged.summary_of(plan.config, plan.config.campaign.store)))
    setup = Setup(replace(plan.config, estimator=_named(PAPER)))
    plain = dict(zip(NAMES, setup.gains.parameter_std[-1] / setup.unit, strict=True))
    return {
        "schedule": plan.config.schedule.name,
        "nees": found["nees_mean"],
        "parameters": {
            name: {
                "rmse": found["parameters"][name]["rmse"],
                "predicted_std": found["parameters"][name]["predicted_std"],
                "predicted_std_of_36": float(plain[name]),
                "unit": UNITS[NAMES.index(name)],
            }
            for name in _SHARED
        },
    }


def _price(store: str, base: str) -> dict[str, Any]:
    """RMSE of a filter over that of the paper's where nothing is disturbed, paired run by run."""
    found = judged.comparison_of(store, base)
    keys = ("ratio", "simultaneous_lower", "simultaneous_upper")
    return {
        str(name): [float(found[key][place]) for key in keys]
        for place, name in enumerate(found["parameter"].values)
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
    rows, price = found["campaigns"], found["price"]
    alone = [row for row in rows if row["filter"] in AUGMENTATIONS]
    named = [row for row in rows if row["filter"] not in AUGMENTATIONS]
    low, high = found["nees_limits"]
    robust = next(r for r in named if (r["filter"], r["truth"]) == ("robust", LABORATORY))
    return render(
        _TEMPLATES,
        "estimators.md.jinja",
        **{key: found[key] for key in found if key not in ("campaigns", "price", "separated")},
        alone=[_cells_alone(row) for row in alone],
        count=len(alone),
        within=[row["filter"] for row in alone if low <= row["nees"] <= high],
        outside=[row["filter"] for row in alone if not low <= row["nees"] <= high],
        named=[_cells_named(row) for row in named],
        robust=robust,
        apart=list(APART),
        separated=[one["schedule"] for one in found["separated"]],
        separated_nees=[one["nees"] for one in found["separated"]],
        shared=[_cells_shared(name, found["separated"]) for name in _SHARED],
        filters=list(price),
        price=[(md.code(name), *(_ratio(price[which][name]) for which in price)) for name in NAMES],
        dearest={which: max(rows, key=lambda name: rows[name][0]) for which, rows in price.items()},
        price_of=price,
    )


def _ratio(values: Sequence[float]) -> str:
    ratio, low, high = values
    return f"{ratio:.3f} ({low:.3f} to {high:.3f})"


def _cells_shared(name: str, paths: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    cells = [md.code(name), paths[0]["parameters"][name]["unit"]]
    for path in paths:
        own = path["parameters"][name]
        keys = ("predicted_std_of_36", "predicted_std", "rmse")
        cells += [f"{own[key]:.3g}" for key in keys]
    return tuple(cells)


def _range(row: Mapping[str, Any]) -> str:
    (_, low), (_, high) = row["least"], row["most"]
    return f"{low:.2f} to {high:.2f}"


def _cells_alone(row: Mapping[str, Any]) -> tuple[str, ...]:
    own = np.array(list(row["augmented"].values()))
    return (
        md.code(row["filter"]),
        str(row["states"]),
        f"{row['nees_of_36']:.4g}",
        f"{row['nees']:.2f}",
        _range(row),
        f"{own.min():.2f} to {own.max():.2f}" if len(own) else "wanders",
    )


def _cells_named(row: Mapping[str, Any]) -> tuple[str, ...]:
    low, high = row["true_over_formal"]
    return (
        md.code(row["filter"]),
        row["truth"],
        str(row["states"]),
        f"{row['nees']:.4g}",
        f"{row['expected_nees']:.4g}",
        f"{low:.2f} to {high:.2f}",
        _range(row),
        f"{md.code(row['most'][0])}",
        findings.joint_text(row),
    )
