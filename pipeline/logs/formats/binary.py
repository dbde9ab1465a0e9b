"""Plain binary numbers."""

from pathlib import Path

import numpy as np

from pipeline.console.errors import DataError
from pipeline.logs.formats.rows import Rows
from pipeline.logs.header import TIME_UNITS, Header


def read(about: Header) -> Rows:
    """Read seven little-endian numbers of double precision a row: time, gyros, accelerometers."""
    path = about.data[0]
    if Path(path).stat().st_size % 56:
        raise DataError(f"{path}: cut short: no whole number of rows of 56 bytes")
    values = np.fromfile(path, dtype="<f8").reshape(-1, 7)
    return Rows(values[:, 0] * TIME_UNITS[about.time_unit], values[:, 1:4], values[:, 4:7])
