"""An error budget as tables for other programs, and as a page to set a laboratory up by."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from inscal.parameters import NAMES, UNITS
from pipeline.config.disturbance import size_of
from pipeline.config.schema import Config
from pipeline.study.budget import MOST, Sheet
from pipeline.study.findings import ENOUGH
from pipeline.words import markdown as md
from pipeline.words.render import render

_TEMPLATES = Path(__file__).parent / "templates"
_SHOWN = 3
HIDES = 0.05
"""Trace over effect below which a disturbance is called hidden."""
_SEEN = 0.01  # sigmas that are an effect at all
_ALIKE = 0.3  # of the largest effect in sigmas: parameters named


def shares(found: Sheet) -> pd.DataFrame:
    """Variances by parameter and source.

    Parameters
    ----------
    found : Sheet

    Returns
    -------
    pandas.DataFrame
        Columns parameter, unit, source, key and size (of disturbances that have one), variance (in
        paper units squared), share of the true variance, and rank within the parameter from 1.
    """
    sources, share = list(found.variance), found.share.T
    rank = 1 + np.argsort(np.argsort(-share, axis=1, kind="stable"), axis=1, kind="stable")
    sized = [found.size.get(source, ("", np.nan)) for source in sources]
    return pd.DataFrame(
        {
            "parameter": np.repeat(NAMES, len(sources)),
            "unit": np.repeat(UNITS, len(sources)),
            "source": np.tile(sources, len(NAMES)),
            "key": np.tile([key for key, _ in sized], len(NAMES)),
            "size": np.tile([size for _, size in sized], len(NAMES)),
            "variance": np.array(list(found.variance.values())).T.ravel(),
            "share": share.ravel(),
            "rank": rank.ravel(),
        }
    )


def sensitivities(found: Sheet) -> pd.DataFrame:
    """Signed effects on the estimates of one unit of every constant.

    Parameters
    ----------
    found : Sheet

    Returns
    -------
    pandas.DataFrame
        Columns key, component (from 0: axis, turn or pair, in the order of
        `inscal.disturbance.COMPONENTS`), parameter, unit, and effect: of one unit of the key in
        that of the parameter, estimate less truth.
    """
    rows: list[tuple[Any, ...]] = []
    for source, effects in found.budget.effects.items():
        key, _ = found.size[source]
        _, one = size_of(key)
        for component, column in enumerate(effects.T * one / found.unit):
            rows += [
                (key, component, name, unit, value)
                for name, unit, value in zip(NAMES, UNITS, column, strict=True)
            ]
    return pd.DataFrame(rows, columns=["key", "component", "parameter", "unit", "effect"])


def tolerances(found: Sheet) -> pd.DataFrame:
    """Largest sizes of each disturbance alone.

    Parameters
    ----------
    found : Sheet

    Returns
    -------
    pandas.DataFrame
        Columns key, size (here), sigma and sigma_by, bounds and bounds_by: the largest sizes of
        `Sheet.tolerance` and the parameters that set them.
    """
    rows = []
    for source, (key, size) in found.size.items():
        limits = found.tolerance(source)
        rows.append((key, size, *limits["sigma"], *limits["bounds"]))
    return pd.DataFrame(rows, columns=["key", "size", "sigma", "sigma_by", "bounds", "bounds_by"])


def traces(found: Sheet) -> pd.DataFrame:
    """What each constant does to the estimates, and what of it the innovations show.

    Parameters
    ----------
    found : Sheet

    Returns
    -------
    pandas.DataFrame
        Columns key, size, component (as in `sensitivities`), moved and trace, both in sigmas at
        that size (`Sheet.hiding`), and hides: whether the trace is below `HIDES` of what is moved.
    """
    rows: list[tuple[Any, ...]] = []
    for source, (moved, trace) in found.hiding.items():
        key, size = found.size[source]
        for component, (far, seen) in enumerate(zip(moved, trace, strict=True)):
            rows.append((key, size, component, far, seen, far > _SEEN and seen < HIDES * far))
    return pd.DataFrame(rows, columns=["key", "size", "component", "moved", "trace", "hides"])


def csv(table: pd.DataFrame) -> str:
    """Text of a table, six significant digits."""
    return table.to_csv(index=False, float_format="%.6g")


def page(config: Config, found: Sheet, name: str, place: int) -> str:
    """Write the page.

    Parameters
    ----------
    config : Config
        What the budget is of.
    found : Sheet
    name : str
        With which the names of the files beside the page begin.
    place : int
        Parameter whose budget is drawn over time.

    Returns
    -------
    str
    """
    allowed: Any = tolerances(found)
    hiding = traces(found)
    rows: list[Any] = sorted(allowed.itertuples(), key=lambda row: row.sigma / row.size)
    return render(
        _TEMPLATES,
        "budget.md.jinja",
        beside=name,
        schedule=config.schedule.name,
        noise=config.noise.name,
        disturbance=config.disturbance.name,
        expected_nees=found.budget.expected_nees,
        modelled=int((found.formal_std > 0.0).sum()),
        most=MOST,
        enough=ENOUGH,
        parameters=_parameter_rows(found),
        tolerances=[_tolerance_cells(row) for row in rows],
        exceeded=[md.code(row.key) for row in rows if row.size > row.sigma],
        present=len(rows),
        over_time=md.code(NAMES[place]),
        constants=len(found.hiding),
        hides=HIDES,
        hidden=[_hidden_cells(found, row) for row in hiding[hiding.hides].itertuples()],
    )


def _parameter_rows(found: Sheet) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for i, name in enumerate(NAMES):
        formal, true = found.formal_std[i], found.true_std[i]
        if not formal > 0.0:
            continue
        most = ", ".join(f"{s} {md.percent(share)}" for s, share in found.largest(i, _SHOWN))
        ratio = f"{true / formal:.2f}"
        rows.append((md.code(name), UNITS[i], most, f"{formal:.3g}", f"{true:.3g}", ratio))
    return rows


def _hidden_cells(found: Sheet, row: Any) -> tuple[str, ...]:
    """Cells of a constant that hides, with the parameters that it is taken for, per unit."""
    source, one = size_of(row.key)
    effect = found.budget.effects[source][:, row.component] * one / found.unit
    weight = np.divide(
        np.abs(effect), found.formal_std, out=np.zeros_like(effect), where=found.formal_std > 0.0
    )
    most = [i for i in np.argsort(-weight, kind="stable") if weight[i] > _ALIKE * weight.max()]
    taken = ", ".join(f"{md.code(NAMES[i])} {effect[i]:+.2g} {UNITS[i]}" for i in most)
    several = len(found.hiding[source][0]) > 1
    called = md.code(row.key) + (f" {row.component}" if several else "")
    return called, taken, f"{row.size:g}", f"{row.moved:.2g}", f"{row.trace:.2g}"


def _tolerance_cells(row: Any) -> tuple[str, ...]:
    sizes = [f"{value:.2g}" if np.isfinite(value) else "any" for value in (row.sigma, row.bounds)]
    by = [
        md.code(name) if np.isfinite(value) else ""
        for name, value in ((row.sigma_by, row.sigma), (row.bounds_by, row.bounds))
    ]
    return md.code(row.key), by[0], by[1], f"{row.size:g}", *sizes
