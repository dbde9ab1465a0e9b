"""Readers of logs, one for each format: times and raw numbers, row by row."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from inscal.units import ARCSEC, MICRO_G
from pipeline.console.errors import DataError
from pipeline.logs.header import TIME_UNITS, Header


@dataclass(frozen=True)
class Rows:
    """A log as it is in its file.

    Attributes
    ----------
    time : ndarray, shape (rows,)
        s.
    gyro, accel : ndarray, shape (rows, 3)
        In the file's axes and numbers.
    observed : ndarray, shape (rows, 6), or None
        m/s and m.
    """

    time: np.ndarray
    gyro: np.ndarray
    accel: np.ndarray
    observed: np.ndarray | None = None


def read_rows(about: Header) -> Rows:
    """Read the rows of a log.

    Parameters
    ----------
    about : Header

    Returns
    -------
    Rows

    Raises
    ------
    DataError
        If a file is missing, or does not hold what the header says.
    """
    for name in about.data:
        if not Path(name).is_file():
            raise DataError(f"{name}: not found; the header's data names it")
    try:
        return _READERS[about.format](about)
    except (OSError, ValueError, UnicodeError) as error:
        line = str(error).splitlines()[0][:120]
        raise DataError(f"{about.data[0]}: no log of format {about.format} ({line})") from None


def read_frame(path: str, **options: Any) -> pd.DataFrame:
    """Read a table, Parquet by its ending and else CSV, with options of the reader of CSV."""
    return pd.read_parquet(path) if path.endswith(".parquet") else pd.read_csv(path, **options)


def _table(about: Header) -> Rows:
    """Columns by name, of Parquet or CSV."""
    path = about.data[0]
    sensors = [about.time_column, *about.gyro_columns, *about.accel_columns]
    wanted = sensors + (about.observed_columns or [])
    frame = read_frame(path, comment="#")
    for name in wanted:
        if name not in frame.columns:
            raise DataError(
                f"{path}: no column {name}; it has {', '.join(map(str, frame.columns))}"
            )
    for name in wanted:
        if not pd.api.types.is_numeric_dtype(frame[name]):
            numbers = pd.to_numeric(frame[name], errors="coerce")
            row = int(np.flatnonzero(numbers.isna() & frame[name].notna())[0])
            raise DataError(f"{path}: row {row + 1}: {name} = {frame[name][row]!r}: no number")
    values = frame[wanted].to_numpy(dtype=float)
    time = values[:, 0] * TIME_UNITS[about.time_unit]
    observed = values[:, 7:] if about.observed_columns else None
    return Rows(time, values[:, 1:4], values[:, 4:7], observed)


def _psins_bin(about: Header) -> Rows:
    """Seven float32 a row: angle and velocity increments, time."""
    path = about.data[0]
    if Path(path).stat().st_size % 28:
        raise DataError(f"{path}: cut short: no whole number of rows of 28 bytes")
    values = np.fromfile(path, dtype="<f4").reshape(-1, 7).astype(float)
    return Rows(values[:, 6], values[:, :3], values[:, 3:6])


def _psins_imu(about: Header) -> Rows:
    """Text: comments, three lines of settings, then six counts a row."""
    path = about.data[0]
    frame = pd.read_csv(path, comment="%", header=None, sep=r"\s+", names=range(6))
    settings, rows = frame.iloc[:3].to_numpy(float), frame.iloc[3:].to_numpy(float)
    interval, scale = 1e-3 * settings[1, 4], settings[2].copy()
    scale[:3] *= ARCSEC  # a count, arcsec and ug s
    scale[3:] *= MICRO_G
    time = settings[1, 3] + interval * np.arange(1, len(rows) + 1)
    return Rows(time, rows[:, :3] * scale[:3], rows[:, 3:] * scale[3:])


def _counts(about: Header) -> Rows:
    """Two texts, accelerometers and gyros, of four numbers a row: time and three counts."""
    accel, gyro = (
        pd.read_csv(name, header=None, sep=r"\s+", names=range(4)).to_numpy(float)
        for name in about.data
    )
    if len(accel) != len(gyro):
        raise DataError(f"{about.data[1]}: {len(gyro)} rows, where the other file has {len(accel)}")
    return Rows(accel[:, 0] * TIME_UNITS[about.time_unit], gyro[:, 1:], accel[:, 1:])


_READERS: dict[str, Callable[[Header], Rows]] = {
    "table": _table,
    "psins_bin": _psins_bin,
    "psins_imu": _psins_imu,
    "counts": _counts,
}
