"""A log navigated freely, with and without compensation."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from inscal import units
from inscal.free_inertial import Flight, fly_record
from inscal.motion import Site
from inscal.parameters import AUGMENTATIONS, COUNT, NAMES
from pipeline.config import files
from pipeline.config.schema import Config
from pipeline.console.errors import DataError
from pipeline.logs.calibration import unit_of
from pipeline.logs.checked import read_increments, rests_and_turns
from pipeline.logs.header import read_header
from pipeline.words.render import render

LANES = ("without", "with")
_TEMPLATES = Path(__file__).parent / "templates"
_EVERY = 1.0  # s, from one entry of the course to the next
_FURTHER = {name for group in AUGMENTATIONS.values() for name in group.names}


@dataclass(frozen=True)
class Flown:
    """Errors of a log navigated freely.

    Attributes
    ----------
    log, compensation : str
        Files.
    flight : Flight
        Lanes are those of `LANES`.
    left_aside : list of str
        Parameters of the compensation that are not of the sensor model, and not applied.
    """

    log: str
    compensation: str
    flight: Flight
    left_aside: list[str]


def flown(config: Config) -> Flown:
    """Navigate the log of a configuration.

    Raises
    ------
    DataError
        If the log or the compensation cannot be used.
    """
    header, path = read_header(config.log or ""), str(config.compensation)
    site = Site(header.latitude_deg * units.DEGREE, header.height_m)
    parameters, aside = read_compensation(path)
    record = read_increments(header)
    parts = rests_and_turns(header.data[0], record)
    lanes = np.stack([np.zeros(COUNT), parameters], axis=1)
    every = max(1, round(_EVERY / record.interval))
    return Flown(
        header.data[0], path, fly_record(record, parts[0], lanes, site, every=every), aside
    )


def read_compensation(path: str) -> tuple[np.ndarray, list[str]]:
    """Read a compensation file.

    Parameters
    ----------
    path : str
        YAML: parameters in the units in which `pipeline.calibrate` writes them.

    Returns
    -------
    parameters : ndarray, shape (27,)
        SI; zero where the file has none.
    left_aside : list of str
        Of augmented states.

    Raises
    ------
    DataError
        If it is no such file.
    """
    found = files.mapping(path, "compensation", "a readable YAML file, parameter: number")
    if not set(found) & set(NAMES):
        raise DataError(f"compensation = {path}: must say parameter: number")
    out, aside = np.zeros(COUNT), []
    for name, value in found.items():
        if name not in NAMES and name not in _FURTHER:
            raise DataError(f"{path}: {name}: no parameter")
        if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
            raise DataError(f"{path}: {name} = {value!r}: must be a number")
        if name in NAMES:
            out[NAMES.index(name)] = value * unit_of(name)[1]
        else:
            aside.append(name)
    return out, aside


def rows(found: Flown) -> list[tuple[str, ...]]:
    """Greatest errors without and with compensation, in words."""
    flight = found.flight
    speed = np.linalg.norm(flight.velocity, axis=1)
    distance = np.linalg.norm(flight.position, axis=1)
    hours = flight.time[-1] / 3600.0
    return [
        ("largest velocity error, m/s", *(f"{v:.3g}" for v in speed.max(axis=0))),
        ("velocity error, rms, m/s", *(f"{v:.3g}" for v in np.sqrt((speed**2).mean(axis=0)))),
        ("largest position error, m", *(f"{v:.4g}" for v in distance.max(axis=0))),
        (
            "position error at the end over time, nautical miles/h",
            *(f"{v / units.NAUTICAL_MILE / hours:.3g}" for v in distance[-1]),
        ),
    ]


def content(found: Flown) -> dict[str, Any]:
    """What was found, as it is written."""
    flight = found.flight
    out: dict[str, Any] = {
        "log": found.log,
        "compensation": found.compensation,
        "left_aside": found.left_aside,
        "time_s": flight.time.tolist(),
    }
    for lane, name in enumerate(LANES):
        out[name] = {
            "velocity_m_per_s": flight.velocity[:, :, lane].T.tolist(),
            "position_m": flight.position[:, :, lane].T.tolist(),
        }
    return out


def page(found: Flown, figure: str) -> str:
    """One page on the flight."""
    return render(_TEMPLATES, "flight.md.jinja", found=found, rows=rows(found), figure=figure)
