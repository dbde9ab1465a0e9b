"""Columns by name, of Parquet or CSV."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from pipeline.console.errors import DataError
from pipeline.logs.formats.rows import Rows
from pipeline.logs.header import TIME_UNITS, Header


def read_frame(path: str, **options: Any) -> pd.DataFrame:
    """Read a table, Parquet by its ending and else CSV, with options of the reader of CSV."""
    return pd.read_parquet(path) if path.endswith(".parquet") else pd.read_csv(path, **options)


def read(about: Header) -> Rows:
    """Read the columns that a header names."""
    column = _source(about.data[0])
    time, gyro, accel = map(column, ([about.time_column], about.gyro_columns, about.accel_columns))
    observed = about.observed_columns
    return Rows(
        time[:, 0] * TIME_UNITS[about.time_unit],
        gyro,
        accel,
        None if observed is None else column(observed),
    )


def _source(path: str) -> Callable[[list[str]], np.ndarray]:
    """What gives columns of a file by name, as numbers, shape (rows, names): never all at once."""
    if path.endswith(".parquet"):
        from pyarrow import default_memory_pool, parquet

        with parquet.ParquetFile(path) as file:
            known, rows = file.schema_arrow.names, file.metadata.num_rows

        def column(name: str) -> pd.Series:
            default_memory_pool().release_unused()  # of the column before, which is copied by now
            return pd.read_parquet(path, columns=[name])[name]

    else:
        frame = pd.read_csv(path, comment="#")
        known, rows = list(map(str, frame.columns)), len(frame)

        def column(name: str) -> pd.Series:
            return frame[name]

    def numbers(names: list[str]) -> np.ndarray:
        out = np.empty((rows, len(names)))
        for place, name in enumerate(names):
            if name not in known:
                raise DataError(f"{path}: no column {name}; it has {', '.join(known)}")
            out[:, place] = _numbers(path, name, column(name))
        return out

    return numbers


def _numbers(path: str, name: str, values: pd.Series) -> np.ndarray:
    if not pd.api.types.is_numeric_dtype(values):
        as_numbers = pd.to_numeric(values, errors="coerce")
        row = int(np.flatnonzero(as_numbers.isna() & values.notna())[0])
        raise DataError(f"{path}: row {row + 1}: {name} = {values[row]!r}: no number")
    return values.to_numpy(dtype=float)
