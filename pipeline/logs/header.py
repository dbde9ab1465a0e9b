"""The header of a log: a YAML file that says what its columns are."""

from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from inscal import units
from pipeline.config import files
from pipeline.console.errors import DataError

FORMATS = ("table", "psins_bin", "psins_imu", "counts", "novatel", "float64")
"""Readable formats, of `pipeline.logs.formats`."""
OBSERVATIONS = ("position_velocity", "velocity_at_rest")
"""What of the unit's place is known: where it is at all times, or that it does not move at rest."""
GYRO_UNITS = {
    "rad": 1.0,
    "deg": units.DEGREE,
    "arcsec": units.ARCSEC,
    "rad/s": 1.0,
    "deg/s": units.DEGREE,
    "deg/h": units.DEG_PER_HOUR,
}
ACCEL_UNITS = {
    "m/s": 1.0,
    "m/s^2": 1.0,
    "g": units.STANDARD_GRAVITY,
    "mg": 1e-3 * units.STANDARD_GRAVITY,
    "ug": units.MICRO_G,
}
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
TIME = "time"
"""Columns of a table if a header does not say others."""
GYRO, ACCEL = ([f"{sensor}_{axis}" for axis in "xyz"] for sensor in ("gyro", "accel"))
OBSERVED = ("velocity_n", "velocity_e", "velocity_d", "position_n", "position_e", "position_d")
"""Columns of observations, m/s and m from the site, of logs that `pipeline.export` writes."""
_INCREMENTS = ("rad", "deg", "arcsec", "m/s")


@dataclass(frozen=True)
class Header:
    """What a log's columns are.

    Attributes
    ----------
    data : list of str
        Files, relative to the header; of format ``counts`` that of the accelerometers first.
    format : str
        One of `FORMATS`.
    latitude_deg, height_m : float
        Of the site.
    gyro_unit, accel_unit : str
        Keys of `GYRO_UNITS` and `ACCEL_UNITS`; those without a time are increments.
    gyro_columns, accel_columns : list of str
        Of a table.
    observed_columns : list of str or None
        Of a table: velocity (m/s) and offset from the site (m), North, East and Down, at updates.
        None: the unit is turned about a point that stands still.
    time_column, time_unit : str
    gyro_scale, accel_scale : float
        Units per number in the file, of counts say.
    gyro_offset, accel_offset : float
        Number in the file that stands for zero, of counts say.
    axes : list of str
        Body axes x, y, z in the file's: such as ``[y, -x, z]``. Right-handed.
    rate_hz : float or None
        Samples a second; None: as the times say.
    observation : str
        One of `OBSERVATIONS`.
    schedule : str or None
        Name of the schedule that it should show.
    """

    data: list[str]
    format: str
    latitude_deg: float
    height_m: float = 0.0
    gyro_unit: str = "rad"
    accel_unit: str = "m/s"
    gyro_columns: list[str] = field(default_factory=lambda: [*GYRO])
    accel_columns: list[str] = field(default_factory=lambda: [*ACCEL])
    observed_columns: list[str] | None = None
    time_column: str = TIME
    time_unit: str = "s"
    gyro_scale: float = 1.0
    accel_scale: float = 1.0
    gyro_offset: float = 0.0
    accel_offset: float = 0.0
    axes: list[str] = field(default_factory=lambda: ["x", "y", "z"])
    rate_hz: float | None = None
    observation: str = "position_velocity"
    schedule: str | None = None

    @property
    def rotation(self) -> np.ndarray:
        """Body axes from the file's, shape (3, 3)."""
        out = np.zeros((3, 3))
        for row, axis in enumerate(self.axes):
            out[row, "xyz".index(axis[-1])] = -1.0 if axis.startswith("-") else 1.0
        return out

    @property
    def gyro_unit_si(self) -> float:
        """Rad or rad/s of one number in the file."""
        return self.gyro_scale * GYRO_UNITS[self.gyro_unit]

    @property
    def accel_unit_si(self) -> float:
        """m/s or m/s^2 of one number in the file."""
        return self.accel_scale * ACCEL_UNITS[self.accel_unit]

    @property
    def gyro_increments(self) -> bool:
        """Whether gyros report angles, and not rates."""
        return self.gyro_unit in _INCREMENTS

    @property
    def accel_increments(self) -> bool:
        """Whether accelerometers report velocities, and not specific forces."""
        return self.accel_unit in _INCREMENTS


def read_header(path: str | Path) -> Header:
    """Read a header.

    Parameters
    ----------
    path : str or Path
        Of the YAML file.

    Returns
    -------
    Header
        Paths of its data are made relative to the working folder.

    Raises
    ------
    DataError
        If it cannot be read, or says something that is not allowed.
    """
    file = Path(path)
    found = files.mapping(path, "log", "the YAML header of a log, key: value")
    known = {about.name for about in fields(Header)}
    for key in found:
        if key not in known:
            raise DataError(f"{path}: {key}: no key of a header; {', '.join(sorted(known))} are")
    for key in ("data", "format", "latitude_deg"):
        if key not in found:
            raise DataError(f"{path}: {key}: missing")
    data = found["data"] if isinstance(found["data"], list) else [found["data"]]
    about = Header(**{**found, "data": [str(file.parent / str(name)) for name in data]})
    _check(path, about)
    return about


def _check(path: str | Path, about: Header) -> None:
    def refuse(key: str, allowed: str) -> None:
        raise DataError(f"{path}: {key} = {getattr(about, key)!r}: must be {allowed}")

    choices: dict[str, Any] = {
        "format": FORMATS,
        "observation": OBSERVATIONS,
        "gyro_unit": tuple(GYRO_UNITS),
        "accel_unit": tuple(ACCEL_UNITS),
        "time_unit": tuple(TIME_UNITS),
    }
    for key, allowed in choices.items():
        if getattr(about, key) not in allowed:
            refuse(key, f"one of {', '.join(allowed)}")
    numbers = "latitude_deg", "height_m", "gyro_scale", "accel_scale", "gyro_offset"
    for key in (*numbers, "accel_offset", "rate_hz"):
        value = getattr(about, key)
        if value is None and key == "rate_hz":
            continue
        if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
            refuse(key, "a number")
    if abs(about.latitude_deg) > 89.9:
        refuse("latitude_deg", "from -89.9 to 89.9")
    for key in ("gyro_scale", "accel_scale", "rate_hz"):
        if getattr(about, key) is not None and not getattr(about, key) > 0.0:
            refuse(key, "above zero")
    for key in ("gyro_columns", "accel_columns", "axes"):
        value = getattr(about, key)
        if not isinstance(value, list) or len(value) != 3 or len({str(v) for v in value}) != 3:
            refuse(key, "a list of three")
    observed = about.observed_columns
    if observed is not None and (not isinstance(observed, list) or len(set(observed)) != 6):
        refuse("observed_columns", "null, or a list of six")
    if any(axis not in ("x", "y", "z", "-x", "-y", "-z") for axis in about.axes):
        refuse("axes", "three of x, y, z, -x, -y, -z")
    if not np.isclose(np.linalg.det(about.rotation), 1.0):
        refuse("axes", "right-handed, such as [x, y, z] or [y, -x, z]")
    if len(about.data) != (2 if about.format == "counts" else 1):
        refuse("data", "two files of counts, or one of any other format")
