"""Files of PSINS, a toolbox for strapdown navigation: binary increments, or counts as text."""

from pathlib import Path

import numpy as np
import pandas as pd

from inscal.units import ARCSEC, MICRO_G
from pipeline.console.errors import DataError
from pipeline.logs.formats.rows import Rows
from pipeline.logs.header import Header


def read_bin(about: Header) -> Rows:
    """Seven float32 a row: angle and velocity increments, time."""
    path = about.data[0]
    if Path(path).stat().st_size % 28:
        raise DataError(f"{path}: cut short: no whole number of rows of 28 bytes")
    values = np.fromfile(path, dtype="<f4").reshape(-1, 7).astype(float)
    return Rows(values[:, 6], values[:, :3], values[:, 3:6])


def read_imu(about: Header) -> Rows:
    """Text: comments, three lines of settings, then six counts a row."""
    path = about.data[0]
    frame = pd.read_csv(path, comment="%", header=None, sep=r"\s+", names=range(6))
    settings, rows = frame.iloc[:3].to_numpy(float), frame.iloc[3:].to_numpy(float)
    interval, scale = 1e-3 * settings[1, 4], settings[2].copy()
    scale[:3] *= ARCSEC  # a count, arcsec and ug s
    scale[3:] *= MICRO_G
    time = settings[1, 3] + interval * np.arange(1, len(rows) + 1)
    return Rows(time, rows[:, :3] * scale[:3], rows[:, 3:] * scale[3:])
