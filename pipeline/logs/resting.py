"""Noise of a unit from a rest in its log: fitted, and written as configuration."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from inscal import units
from inscal.allan import KINDS, NoiseFit, fit_noise
from inscal.recorded import Increments, stretches
from pipeline.config.disturbance import size_of, unit_text
from pipeline.config.schema import Config
from pipeline.console.errors import ConfigError, DataError
from pipeline.logs.checked import read_increments
from pipeline.logs.header import read_header
from pipeline.words.render import render

SENSORS = ("gyro", "accel")
_TEMPLATES = Path(__file__).parent / "templates"
_PULSE = np.sqrt(12.0)  # of a pulse: one over the standard deviation of what it cuts off
_MARK = "by `python -m pipeline.noise`"
# key of the configuration that each kind of noise is, of each sensor
_KEYS = {
    "gyro": {
        "white": "gyro_angle_random_walk_deg_per_sqrt_h",
        "flicker": "gyro_flicker_deg_per_h",
        "random_walk": "gyro_rate_random_walk_deg_per_h_per_sqrt_h",
        "quantisation": "gyro_quantisation_arcsec",
    },
    "accel": {
        "white": "accel_white_noise_ug_per_sqrt_hz",
        "flicker": "accel_flicker_ug",
        "random_walk": "accel_random_walk_ug_per_sqrt_h",
        "quantisation": "accel_quantisation_m_per_s",
    },
}
_WHITE = {
    "gyro": ("deg/sqrt(h)", units.DEG_PER_SQRT_HOUR),
    "accel": ("ug/sqrt(Hz)", units.MICRO_G),
}


@dataclass(frozen=True)
class Resting:
    """Noise of a unit at rest.

    Attributes
    ----------
    log : str
        File it was recorded in.
    first_s, last_s : float
        The rest.
    interval : float
        Of a sample, s.
    fits : dict of str to list of NoiseFit
        Of each of `SENSORS`: x, y, z; of rates in rad/s and forces in m/s^2.
    """

    log: str
    first_s: float
    last_s: float
    interval: float
    fits: dict[str, list[NoiseFit]]


def noise_of(config: Config) -> Resting:
    """Noise in the longest rest of a log.

    Raises
    ------
    DataError
        If the log cannot be read, or has no rest that tells anything.
    """
    header = read_header(config.log or "")
    name, record = header.data[0], read_increments(header)
    try:
        rest = max(
            (part for part in stretches(record) if not part.turns),
            key=lambda part: part.end - part.first,
        )
        fits = {
            sensor: [fit_noise(rate, record.interval) for rate in values[rest.first : rest.end].T]
            for sensor, values in zip(SENSORS, _rates(record), strict=True)
        }
    except ValueError as error:
        raise DataError(f"{name}: {error}") from None
    first, last = rest.first * record.interval, rest.end * record.interval
    return Resting(name, first, last, record.interval, fits)


def _rates(record: Increments) -> tuple[np.ndarray, np.ndarray]:
    return record.angle / record.interval, record.velocity / record.interval


def unit_of(sensor: str, kind: str) -> tuple[str, float]:
    """Unit in which a kind of noise is told: its name, and its size in SI."""
    if kind == "white":
        return _WHITE[sensor]
    key = _KEYS[sensor][kind]
    text, size = unit_text(key), size_of(key)[1]
    return text, size / _PULSE if kind == "quantisation" else size


def together(sensor: list[NoiseFit], kind: str) -> float:
    """Root mean square over the axes, SI."""
    return float(np.sqrt(np.mean([fit.size[kind] ** 2 for fit in sensor])))


def rows(found: Resting, *, intervals: bool) -> list[tuple[str, ...]]:
    """Sensor, kind, unit, and sizes on the axes, with their intervals or without, in words."""
    out: list[tuple[str, ...]] = []
    for sensor, fits in found.fits.items():
        for kind in KINDS:
            unit, size = unit_of(sensor, kind)
            cells = [
                f"{fit.size[kind] / size:.3g}"
                + f" ({fit.size_lower[kind] / size:.2g} to {fit.size_upper[kind] / size:.2g})"
                * intervals
                for fit in fits
            ]
            out.append((sensor, kind.replace("_", " "), unit, *cells))
    return out


def content(found: Resting) -> dict[str, Any]:
    """What was found, as it is written."""
    out: dict[str, Any] = {"log": found.log, "from_s": found.first_s, "to_s": found.last_s}
    for sensor, fits in found.fits.items():
        out[sensor] = {
            kind: {
                "unit": unit_of(sensor, kind)[0],
                "size": _in_unit(fits, sensor, kind, "size"),
                "lower": _in_unit(fits, sensor, kind, "size_lower"),
                "upper": _in_unit(fits, sensor, kind, "size_upper"),
            }
            for kind in KINDS
        }
    return out


def _in_unit(fits: list[NoiseFit], sensor: str, kind: str, member: str) -> list[float]:
    return [getattr(fit, member)[kind] / unit_of(sensor, kind)[1] for fit in fits]


def page(found: Resting, figure: str, files: Mapping[str, str]) -> str:
    """One page on the noise."""
    return render(
        _TEMPLATES,
        "noise.md.jinja",
        found=found,
        rows=rows(found, intervals=True),
        figure=figure,
        files=files,
    )


def configuration(found: Resting, config: Config) -> dict[str, str]:
    """Texts of the files that have the noise as configuration, by their paths.

    Parameters
    ----------
    found : Resting
    config : Config
        Its `name` is theirs; what is observed has the noise of its group.

    Returns
    -------
    dict of str to str
        Empty without a name.

    Raises
    ------
    ConfigError
        If a file of that name is not of this stage.
    """
    if config.name is None:
        return {}
    out = {}
    for group in ("noise", "disturbance"):
        path = Path("conf") / group / f"{config.name}.yaml"
        if path.exists() and _MARK not in path.read_text(encoding="utf-8"):
            raise ConfigError(f"name = {config.name!r}: {path} is there, and not {_MARK}")
        values = {
            _KEYS[sensor][kind]: together(fits, kind) / unit_of(sensor, kind)[1]
            for sensor, fits in found.fits.items()
            for kind in KINDS
            if (kind == "white") == (group == "noise")
        }
        out[str(path)] = render(
            _TEMPLATES,
            f"{group}.yaml.jinja",
            mark=_MARK,
            log=found.log,
            called=config.name,
            values=values,
            noise=config.noise,
        )
    return out
