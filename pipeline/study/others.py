"""Estimates of any program, judged by the campaign whose runs they are of."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
import yaml

from inscal.parameters import NAMES, UNITS
from inscal.summary import summarize
from pipeline.campaign import judged, store
from pipeline.config.schema import Config
from pipeline.console.errors import DataError
from pipeline.console.output import json_data
from pipeline.logs.formats.table import read_frame
from pipeline.study.findings import contest, contest_verdict, joint_text
from pipeline.words import markdown as md
from pipeline.words.render import render

_TEMPLATES = Path(__file__).parent / "templates"
_STD = "_std"
_KEYS = ("parameter", "factor")


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
    table = renamed(read_table(path), read_mapping(config.mapping), path)
    theirs, with_std = as_campaign(table, own, path)
    names = [str(name) for name in theirs["parameter"].values]
    ours = own.sel(parameter=names, run=theirs["run"])
    bound = judged.bounds_of(config).sel(parameter=names)
    try:
        found = summarize(theirs, bound)
    except ValueError as error:
        raise DataError(f"estimates = {path}: {error}") from None
    pair = judged.comparison(Path(path).with_suffix(""), theirs, place, ours, bound)
    return Judged(names, with_std, *(json_data(judged.as_json(one)) for one in (found, pair)))


def read_table(path: str) -> pd.DataFrame:
    """Read a table of CSV or Parquet; DataError if there is none."""
    try:
        return read_frame(path)
    except FileNotFoundError:
        raise DataError(f"estimates = {path}: not found") from None
    except (OSError, ValueError, UnicodeError) as error:
        line = str(error).splitlines()[0][:80]
        raise DataError(f"estimates = {path}: must be a table, CSV or Parquet ({line})") from None


def read_mapping(path: str | None) -> dict[str, dict[str, Any]]:
    """Read what columns mean that have other names or units.

    Parameters
    ----------
    path : str or None
        YAML file: for each column its `parameter` and a `factor` to the project's printed unit.

    Returns
    -------
    dict

    Raises
    ------
    DataError
        If it is no such file.
    """
    if path is None:
        return {}
    try:
        found = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeError, yaml.YAMLError):
        raise DataError(f"mapping = {path}: must be a readable YAML file") from None
    if not isinstance(found, dict):
        raise DataError(f"mapping = {path}: must say column: {{parameter: ..., factor: ...}}")
    out = {}
    for column, about in found.items():
        about = {"parameter": about} if isinstance(about, str) else about
        if not isinstance(about, dict) or not set(about) <= set(_KEYS):
            raise DataError(f"{path}: {column}: must have {' and '.join(_KEYS)} and no other key")
        factor = about.get("factor", 1.0)
        if isinstance(factor, bool) or not isinstance(factor, int | float) or factor == 0:
            raise DataError(f"{path}: {column}: factor = {factor!r}: must be a number, not zero")
        if about.get("parameter") not in NAMES:
            raise DataError(
                f"{path}: {column}: parameter = {about.get('parameter')!r}: must be one of the "
                f"{len(NAMES)}, such as {NAMES[0]}"
            )
        out[str(column)] = {"parameter": about["parameter"], "factor": float(factor)}
    return out


def renamed(table: pd.DataFrame, mapping: Mapping[str, Any], path: str) -> pd.DataFrame:
    """Table with the project's names and units.

    Raises
    ------
    DataError
        If a column is unknown, or means what another does.
    """
    out: dict[str, np.ndarray] = {}
    for column in table.columns:
        name, factor, ending = str(column), 1.0, ""
        if name.endswith(_STD) and name not in mapping:
            name, ending = name.removesuffix(_STD), _STD
        if name in mapping:
            name, factor = mapping[name]["parameter"], mapping[name]["factor"]
        if name != "run" and name not in NAMES:
            raise DataError(
                f"estimates = {path}: column {column}: no parameter; rename it, or say what it is "
                "in a mapping"
            )
        if name + ending in out:
            raise DataError(f"estimates = {path}: column {column}: {name} is there twice")
        values = pd.to_numeric(table[column], errors="coerce").to_numpy(dtype=float)
        bad = np.isnan(values) & ~table[column].isna().to_numpy()
        if bad.any():
            row = int(np.flatnonzero(bad)[0])
            raise DataError(
                f"estimates = {path}: row {row + 1}: {column} = {table[column].iloc[row]!r}: no "
                "number"
            )
        out[name + ending] = abs(factor) * values if ending else factor * values
    return pd.DataFrame(out)


def as_campaign(table: pd.DataFrame, own: xr.Dataset, path: str) -> tuple[xr.Dataset, list[str]]:
    """Estimates as a campaign of the runs asked for, those that are missing failed.

    Parameters
    ----------
    table : DataFrame
        Of `renamed`.
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
    with_std = [name for name in names if name + _STD in table]
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
        own = table[name + _STD].to_numpy(dtype=float)[first]
        if not (own > 0.0).all():
            raise DataError(f"estimates = {path}: {name}{_STD}: must be above zero in every run")
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
