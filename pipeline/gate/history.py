"""Accuracy over the project's life: one row for every baseline that the gate was given.

A row is what the gate's campaign showed, in figures that a campaign of any size has as well: the
mean NEES, and of each parameter kind the RMSE over the predicted sigma, all runs and parameters of
the kind together.
"""

import csv
import hashlib
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from inscal.parameters import KINDS, members
from pipeline.console.errors import DataError
from pipeline.console.output import write_text

FILE = "history.csv"
"""Name of the file in the baseline's folder."""

_RATIO = "_rmse_over_predicted"
_COLUMNS = ("date", "reason", "runs", "nees_mean", *(k + _RATIO for k in KINDS), "configuration")


@dataclass(frozen=True)
class Row:
    """State of the accuracy at one time.

    Attributes
    ----------
    date, reason : str
        When it became the baseline, and why.
    runs : int
    nees_mean : float
    ratio : mapping of str to float
        RMSE over predicted sigma by parameter kind; NaN where the filter models none.
    configuration : str
        Digest, of `digest`.
    """

    date: str
    reason: str
    runs: int
    nees_mean: float
    ratio: Mapping[str, float]
    configuration: str


def row_of(
    error: np.ndarray,
    predicted_std: np.ndarray,
    nees: np.ndarray,
    configuration: Mapping[str, Any],
    *,
    date: str = "",
    reason: str = "",
) -> Row:
    """Condense a campaign.

    Parameters
    ----------
    error : ndarray, shape (runs, 27)
    predicted_std : ndarray, shape (27,)
        In the unit of `error`; 0 where the filter does not model the parameter.
    nees : ndarray, shape (runs,)
    configuration : mapping
        Of `pipeline.gate.baseline.configuration_of`.
    date, reason : str

    Returns
    -------
    Row
    """
    ratio = {}
    for kind in KINDS:
        own = [index for index in members(kind) if predicted_std[index] > 0.0]
        score = error[:, own] / predicted_std[own]
        ratio[kind] = float(np.sqrt(np.mean(score**2))) if own else float("nan")
    mean = float(np.mean(nees))
    return Row(date, reason, len(error), mean, ratio, digest(configuration))


def digest(configuration: Mapping[str, Any]) -> str:
    """Short digest of what makes the gate's campaign of a configuration."""
    text = json.dumps(configuration, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def read(folder: Path) -> list[Row]:
    """Rows so far, oldest first.

    Raises
    ------
    DataError
        If the file is there and is no history.
    """
    path = folder / FILE
    if not path.exists():
        return []
    try:
        return [
            _row(fields) for fields in csv.DictReader(io.StringIO(path.read_text(encoding="utf-8")))
        ]
    except (OSError, ValueError, KeyError, TypeError):
        raise DataError(f"{path}: cannot be read as the history of baselines") from None


def append(folder: Path, row: Row) -> None:
    """Add a row.

    Raises
    ------
    DataError
        If the file is no history, or cannot be written.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_COLUMNS)
    for one in (*read(folder), row):
        numbers = [f"{value:.6g}" for value in (one.nees_mean, *one.ratio.values())]
        writer.writerow((one.date, one.reason, one.runs, *numbers, one.configuration))
    write_text(folder / FILE, text.getvalue())


def _row(fields: Mapping[str, str]) -> Row:
    return Row(
        fields["date"],
        fields["reason"],
        int(fields["runs"]),
        float(fields["nees_mean"]),
        {kind: float(fields[kind + _RATIO]) for kind in KINDS},
        fields["configuration"],
    )
