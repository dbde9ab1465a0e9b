"""Logs read by the format that their header names."""

from collections.abc import Callable
from pathlib import Path

from pipeline.console.errors import DataError
from pipeline.logs.formats import binary, counts, novatel, psins, table
from pipeline.logs.formats.rows import Rows
from pipeline.logs.header import Header

_READERS: dict[str, Callable[[Header], Rows]] = {
    "table": table.read,
    "psins_bin": psins.read_bin,
    "psins_imu": psins.read_imu,
    "counts": counts.read,
    "novatel": novatel.read,
    "float64": binary.read,
}


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
