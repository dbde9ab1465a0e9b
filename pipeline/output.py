"""Small files and lines a stage leaves."""

import sys
from collections.abc import Iterable
from pathlib import Path

import xarray as xr

from pipeline.config import DataError


def complain(lines: Iterable[str]) -> None:
    """Print warnings on standard error."""
    for line in lines:
        print(line, file=sys.stderr)


def write_text(path: str | Path, text: str) -> None:
    """Write a text file, making its folder.

    Raises
    ------
    DataError
        If the file cannot be written.
    """
    try:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        Path(path).write_text(text)
    except OSError as error:
        raise DataError(f"{path}: cannot be written ({error.strerror})") from None


def table_text(dataset: xr.Dataset) -> str:
    """CSV text of the per-parameter variables of a dataset, six significant digits."""
    table = dataset[[name for name, variable in dataset.data_vars.items() if variable.ndim == 1]]
    frame = table.to_dataframe().reset_index()
    leading = ["parameter", "unit"]
    frame = frame[leading + [name for name in frame.columns if name not in leading]]
    return frame.to_csv(index=False, float_format="%.6g")
