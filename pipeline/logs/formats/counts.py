"""Plain counts."""

import pandas as pd

from pipeline.console.errors import DataError
from pipeline.logs.formats.rows import Rows
from pipeline.logs.header import TIME_UNITS, Header


def read(about: Header) -> Rows:
    """Two texts, accelerometers and gyros, of four numbers a row: time and three counts."""
    accel, gyro = (
        pd.read_csv(name, header=None, sep=r"\s+", names=range(4)).to_numpy(float)
        for name in about.data
    )
    if len(accel) != len(gyro):
        raise DataError(f"{about.data[1]}: {len(gyro)} rows, where the other file has {len(accel)}")
    return Rows(accel[:, 0] * TIME_UNITS[about.time_unit], gyro[:, 1:], accel[:, 1:])
