"""Tables of estimates of any program: names, units and frames made the project's."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from inscal.frames import ACCELEROMETER_FRAME, in_gyro_frame
from inscal.parameters import NAMES
from pipeline.config import files
from pipeline.config.schema import Config
from pipeline.console.errors import DataError
from pipeline.logs.calibration import unit_of
from pipeline.logs.formats.table import read_frame

STD = "_std"
"""Ending of the names of columns of sigmas."""
_KEYS = ("parameter", "factor")
_FRAME, _FRAMES = "frame", ("gyro", "accelerometer")


def read_estimates(config: Config) -> pd.DataFrame:
    """Read the table of a configuration, by its mapping.

    Parameters
    ----------
    config : Config

    Returns
    -------
    DataFrame
        A column ``run``, and one for each parameter in the printed unit, and its sigma with `STD`.

    Raises
    ------
    DataError
        If table or mapping cannot be used.
    """
    path = str(config.estimates)
    frame, mapping = read_mapping(config.mapping)
    table = renamed(read_table(path), mapping, ACCELEROMETER_FRAME if frame else NAMES, path)
    return from_accelerometer_frame(table, path) if frame else table


def read_table(path: str) -> pd.DataFrame:
    """Read a table of CSV or Parquet; DataError if there is none."""
    try:
        return read_frame(path)
    except FileNotFoundError:
        raise DataError(f"estimates = {path}: not found") from None
    except (OSError, ValueError, UnicodeError) as error:
        line = str(error).splitlines()[0][:80]
        raise DataError(f"estimates = {path}: must be a table, CSV or Parquet ({line})") from None


def read_mapping(path: str | None) -> tuple[bool, dict[str, dict[str, Any]]]:
    """Read what columns mean that have other names or units, or are of another frame.

    Parameters
    ----------
    path : str or None
        YAML file: for each column its `parameter` and a `factor` to the project's printed unit;
        and ``frame``, gyro or accelerometer.

    Returns
    -------
    accelerometer_frame : bool
    columns : dict

    Raises
    ------
    DataError
        If it is no such file.
    """
    if path is None:
        return False, {}
    form = "a readable YAML file, column: {parameter: ..., factor: ...}"
    found = files.mapping(path, "mapping", form)
    frame = found.pop(_FRAME, "gyro")
    if frame not in _FRAMES:
        raise DataError(f"{path}: frame = {frame!r}: must be one of {', '.join(_FRAMES)}")
    known = NAMES if frame == "gyro" else ACCELEROMETER_FRAME
    out = {}
    for column, about in found.items():
        about = {"parameter": about} if isinstance(about, str) else about
        if not isinstance(about, dict) or not set(about) <= set(_KEYS):
            raise DataError(f"{path}: {column}: must have {' and '.join(_KEYS)} and no other key")
        factor = about.get("factor", 1.0)
        if isinstance(factor, bool) or not isinstance(factor, int | float) or factor == 0:
            raise DataError(f"{path}: {column}: factor = {factor!r}: must be a number, not zero")
        if about.get("parameter") not in known:
            raise DataError(
                f"{path}: {column}: parameter = {about.get('parameter')!r}: must be one of the "
                f"{len(known)}, such as {known[0]}"
            )
        out[str(column)] = {"parameter": about["parameter"], "factor": float(factor)}
    return frame != "gyro", out


def renamed(
    table: pd.DataFrame, mapping: Mapping[str, Any], known: Sequence[str], path: str
) -> pd.DataFrame:
    """Table with the project's names, of those that are known, and units.

    Raises
    ------
    DataError
        If a column is unknown, or means what another does.
    """
    out: dict[str, np.ndarray] = {}
    for column in table.columns:
        name, factor, ending = str(column), 1.0, ""
        if name.endswith(STD) and name not in mapping:
            name, ending = name.removesuffix(STD), STD
        if name in mapping:
            name, factor = mapping[name]["parameter"], mapping[name]["factor"]
        if name != "run" and name not in known:
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


def from_accelerometer_frame(table: pd.DataFrame, path: str) -> pd.DataFrame:
    """Table of estimates in the accelerometers' frame as one of the 27 parameters.

    Sigmas are carried by derivatives, as of independent errors: a table has no correlations.

    Raises
    ------
    DataError
        If a parameter is missing: all are needed to turn the frame.
    """
    for name in ACCELEROMETER_FRAME:
        if name not in table:
            raise DataError(
                f"estimates = {path}: no column {name}: the accelerometers' frame needs all of its "
                f"{len(ACCELEROMETER_FRAME)} parameters"
            )
    si, printed = (
        np.array([_size(name) for name in names]) for names in (ACCELEROMETER_FRAME, NAMES)
    )
    values = table[list(ACCELEROMETER_FRAME)].to_numpy() * si
    turned = np.array([_turned(row) for row in values]) / printed
    out = {name: turned[:, place] for place, name in enumerate(NAMES)}
    sigmas = [name + STD for name in ACCELEROMETER_FRAME]
    if all(name in table for name in sigmas):
        sigma = table[sigmas].to_numpy() * si
        middle, step = np.nan_to_num(values.mean(axis=0)), sigma.mean(axis=0)
        ends = [[_turned(middle + sign * shift) for shift in np.diag(step)] for sign in (1.0, -1.0)]
        slope = (np.array(ends[0]) - np.array(ends[1])) / (2.0 * step[:, None])
        spread = np.sqrt(np.square(sigma) @ np.square(slope)) / printed
        out |= {name + STD: spread[:, place] for place, name in enumerate(NAMES)}
    return pd.DataFrame({**({"run": table["run"]} if "run" in table else {}), **out})


def _size(name: str) -> float:
    """SI of a printed unit; of the quadratic term, which no frame changes, 1."""
    return 1.0 if name.startswith("accel_quadratic") else unit_of(name)[1]


def _turned(row: np.ndarray) -> np.ndarray:
    if not np.isfinite(row).all():
        return np.full(len(NAMES), np.nan)
    found = in_gyro_frame(dict(zip(ACCELEROMETER_FRAME, row.tolist(), strict=True)))
    return np.array([found[name] for name in NAMES])
