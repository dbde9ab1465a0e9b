"""Estimates of any program, judged by the campaign whose runs they are of."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from inscal.parameters import NAMES, UNITS
from inscal.summary import summarize
from pipeline.campaign import judged, store
from pipeline.config.schema import Config
from pipeline.console.errors import DataError
from pipeline.console.output import json_data
from pipeline.study.estimates import STD, read_estimates
from pipeline.study.findings import contest, contest_verdict, joint_text
from pipeline.words import markdown as md
from pipeline.words.render import render

_TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True)
class Judged:
    """What was found of a table of estimates.

    Attributes
    ----------
    names : list of str
        Parameters that it has, in the project's order.
    with_std : list of str
        Those that it has sigmas of.
    summary : dict
        Of `inscal.summary.summarize`, as JSON has it.
    comparison : dict
        With the campaign's own estimates, of the same runs and parameters.
    """

    names: list[str]
    with_std: list[str]
    summary: dict[str, Any]
    comparison: dict[str, Any]


def judge(config: Config) -> Judged:
    """Judge a table of estimates.

    Parameters
    ----------
    config : Config
        Names the table, its mapping, the store and the bounds.

    Returns
    -------
    Judged

    Raises
    ------
    DataError
        If the table or the store cannot be used.
    """
    path, place = str(config.estimates), config.campaign.store
    own = store.read(place)
    theirs, with_std = as_campaign(read_estimates(config), own, path)
    names = [str(name) for name in theirs["parameter"].values]
    ours = own.sel(parameter=names, run=theirs["run"])
    bound = judged.bounds_of(config).sel(parameter=names)
    try:
        found = summarize(theirs, bound)
    except ValueError as error:
        raise DataError(f"estimates = {path}: {error}") from None
    pair = judged.comparison(Path(path).with_suffix(""), theirs, place, ours, bound)
    return Judged(names, with_std, *(json_data(judged.as_json(one)) for one in (found, pair)))


def as_campaign(table: pd.DataFrame, own: xr.Dataset, path: str) -> tuple[xr.Dataset, list[str]]:
    """Estimates as a campaign of the runs asked for, those that are missing failed.

    Parameters
    ----------
    table : DataFrame
        Of `read_estimates`.
    own : xarray.Dataset
        The campaign, which has the truth.
    path : str
        Of the table, for messages.

    Returns
    -------
    campaign : xarray.Dataset
        As `inscal.summary` takes it, of the runs that the campaign itself has done or failed.
    with_std : list of str
        Parameters with sigmas; NEES is of these.

    Raises
    ------
    DataError
        If there is no column of runs, a run is unknown or there twice, or no parameter is there.
    """
    names = [name for name in NAMES if name in table]
    if "run" not in table:
        raise DataError(f"estimates = {path}: no column run")
    if not names or not len(table):
        raise DataError(f"estimates = {path}: no estimates: columns named as the parameters")
    runs = table["run"].to_numpy()
    known = own["run"].to_numpy()[(own["status"] != store.NOT_RUN).to_numpy()]
    if np.isnan(runs).any() or not np.isin(runs, known).all():
        wrong = runs[~np.isin(runs, known)][0]
        raise DataError(f"estimates = {path}: run = {wrong:g}: no run of {len(known)} in the store")
    numbers, first = np.unique(runs.astype(int), return_index=True)
    if len(numbers) < len(runs):
        twice = pd.Series(runs)[pd.Series(runs).duplicated()].iloc[0]
        raise DataError(f"estimates = {path}: run = {twice:g}: is there twice")
    place = np.searchsorted(known, numbers)
    estimate = np.full((len(known), len(names)), np.nan)
    estimate[place] = table[names].to_numpy(dtype=float)[first]
    done = np.isfinite(estimate).all(axis=1)
    truth = own["truth"].sel(parameter=names, run=known).transpose("run", "parameter").to_numpy()
    with_std = [name for name in names if name + STD in table]
    sigma, nees = _sigmas(table, names, with_std, estimate - truth, place, first, path)
    coordinates = {"run": known, "parameter": names}
    units = [UNITS[NAMES.index(name)] for name in names]
    return (
        xr.Dataset(
            {
                "truth": (("run", "parameter"), truth),
                "estimate": (("run", "parameter"), estimate),
                "error": (("run", "parameter"), estimate - truth),
                "predicted_std": ("parameter", sigma),
                "nees": ("run", nees),
                "status": ("run", np.where(done, store.DONE, store.FAILED).astype(np.int8)),
            },
            coordinates | {"unit": ("parameter", units)},
            own.attrs,
        ),
        with_std,
    )


def _sigmas(table, names, with_std, error, place, first, path):
    """Sigma of every parameter over the runs, and NEES of every run by sigmas alone."""
    sigma, nees = np.zeros(len(names)), np.zeros(len(error))
    for column, name in enumerate(names):
        if name not in with_std:
            continue
        own = table[name + STD].to_numpy(dtype=float)[first]
        if not (own > 0.0).all():
            raise DataError(f"estimates = {path}: {name}{STD}: must be above zero in every run")
        sigma[column] = np.sqrt(np.mean(own**2))
        nees[place] += np.square(error[place, column] / own)
    return sigma, nees


def content(found: Judged) -> dict[str, Any]:
    """What was found, as it is written."""
    return {
        "parameters": found.names,
        "with_sigma": found.with_std,
        "summary": found.summary,
        "comparison": found.comparison,
    }


def rows(found: Judged) -> list[tuple[str, ...]]:
    """Parameter by parameter: errors, bound, and RMSE beside ours."""
    out: list[tuple[str, ...]] = []
    for name in found.names:
        own, pair = found.summary["parameters"][name], found.comparison["parameters"][name]
        share = "share_within_bound"
        ratio = own["rmse_over_predicted"]
        out.append(
            (
                name,
                own["unit"],
                f"{own['rmse']:.3g}",
                f"{ratio:.2f}" if name in found.with_std else "no sigma",
                f"{own['bound']:g}",
                md.share(own[share], own[f"{share}_lower"], own[f"{share}_upper"]),
                f"{pair['ratio']:.3f} ({pair['simultaneous_lower']:.3f} to "
                f"{pair['simultaneous_upper']:.3f})",
            )
        )
    return out


HEADINGS = ("parameter", "unit", "RMSE", "RMSE/sigma", "bound", "within (95 %)", "RMSE over ours")
"""Of `rows`."""


def page(found: Judged) -> str:
    """Write the page of what was found."""
    about = found.summary
    return render(
        _TEMPLATES,
        "judged.md.jinja",
        called=found.comparison["a"],
        store=found.comparison["b"],
        missing=[name for name in NAMES if name not in found.names],
        without=[name for name in found.names if name not in found.with_std],
        count=len(found.with_std),
        joint=joint_text(about),
        verdict=contest_verdict(contest(found.comparison)),
        headings=HEADINGS,
        rows=[(md.code(row[0]), *row[1:]) for row in rows(found)],
        **{key: about[key] for key in ("runs_done", "runs_failed")},
        **{key: about[key] for key in ("nees_mean", "nees_lower", "nees_upper")},
    )
