"""A log calibrated: estimates with their sigmas, what it cannot give, and whether it fits."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from inscal import units
from inscal.estimator import CONSTANTS, Belief
from inscal.frames import DELAY, in_accelerometer_frame
from inscal.motion import Site
from inscal.parameters import AUGMENTATIONS, COUNT, NAMES
from inscal.record_filter import Outcome, calibrate_record
from inscal.recorded import Increments, whole_updates
from pipeline.config.disturbance import key_of, size_of, unit_text
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.console.errors import DataError
from pipeline.logs.checked import read_increments, rests_and_turns
from pipeline.logs.header import Header, read_header
from pipeline.words.render import render

_TEMPLATES = Path(__file__).parent / "templates"
KNOWN = 0.5
"""Share of its prior sigma below which a log gives a parameter."""
_STEP = 1e-3  # of a sigma, for derivatives
_QUADRATIC = units.MICRO_G / units.STANDARD_GRAVITY**2  # ug/g^2
_UNITS: dict[str, tuple[str, float]] = {
    "gyro_bias": ("deg/h", units.DEG_PER_HOUR),
    "accel_bias": ("ug", units.MICRO_G),
    "accel_quadratic": ("ug/g^2", _QUADRATIC),
    "lever_arm": ("mm", units.MILLIMETRE),
    DELAY: ("us", 1e-6),
}
"""Units of a calibration's result, by how names begin; matrices have ppm and arcsec."""


@dataclass(frozen=True)
class Calibrated:
    """Result of a log.

    Attributes
    ----------
    header : Header
    record : Increments
    outcome : Outcome
    parameter, unit : list of str
    estimate, std : ndarray
        In these units.
    given : list of bool
        Whether the log gives the parameter.
    """

    header: Header
    record: Increments
    outcome: Outcome
    parameter: list[str]
    unit: list[str]
    estimate: np.ndarray
    std: np.ndarray
    given: list[bool]


def calibrated(config: Config) -> Calibrated:
    """Calibrate the log of a configuration.

    Parameters
    ----------
    config : Config

    Returns
    -------
    Calibrated

    Raises
    ------
    DataError
        If the log cannot be used, or the filter does not converge on it.
    """
    header = read_header(config.log or "")
    site = Site(header.latitude_deg * units.DEGREE, header.height_m)
    belief = _belief(config)
    try:
        record = whole_updates(read_increments(header), belief.update_interval)
        parts = rests_and_turns(header.data[0], record, site)
        outcome = calibrate_record(
            record,
            parts,
            site,
            belief,
            rounds=config.calibration.rounds,
            at_rest=header.observation == "velocity_at_rest",
        )
    except ValueError as error:
        raise DataError(f"{header.data[0]}: {error}") from None
    if outcome.calibration.reason[0]:
        raise DataError(
            f"{header.data[0]}: the filter does not converge on this log; are site, noise and "
            "state groups right?"
        )
    return _in_frame(config, header, record, outcome, belief)


def _belief(config: Config) -> Belief:
    """What the filter believes of a unit that it has not met."""
    setup, factor = Setup(config), config.calibration.prior_factor
    prior = replace(setup.prior, parameter=factor * setup.prior.parameter)
    sources = {group.source for group in setup.model.augmentations.values() if not group.wanders}
    sizes = {source: factor * getattr(setup.believed, source) for source in sources}
    return replace(
        setup.belief,
        prior=prior,
        augmented=replace(setup.believed, **sizes),
        innovation_limit=np.inf,
    )


def _in_frame(
    config: Config, header: Header, record: Increments, outcome: Outcome, belief: Belief
) -> Calibrated:
    states = [*NAMES, *outcome.estimator.augmented_names]
    own = np.r_[np.arange(COUNT), np.arange(CONSTANTS, CONSTANTS + len(states) - COUNT)]
    covariance = outcome.estimator.first.covariance[np.ix_(own, own)]
    values = np.concatenate([outcome.estimate, outcome.augmented])
    about = outcome.estimator.augmented
    further = about.transitions.constant_std if about else np.zeros(0)
    prior = np.concatenate([belief.prior.parameter, further])
    change = _plain if config.calibration.frame == "gyro" else in_accelerometer_frame
    found = change(dict(zip(states, values, strict=True)))
    slope = _slope(change, states, values, np.sqrt(np.diag(covariance)))
    std = np.sqrt(np.diag(slope @ covariance @ slope.T))
    before = np.sqrt(np.square(slope) @ np.square(prior))
    named = [_unit(name) for name in found]
    size = np.array([unit for _, unit in named])
    return Calibrated(
        header,
        record,
        outcome,
        list(found),
        [name for name, _ in named],
        np.array(list(found.values())) / size,
        std / size,
        [bool(0.0 < s < KNOWN * p) for s, p in zip(std, before, strict=True)],
    )


def _plain(values: dict[str, float]) -> dict[str, float]:
    return values


def _slope(
    change: Callable[[dict[str, float]], dict[str, float]],
    states: list[str],
    values: np.ndarray,
    sigma: np.ndarray,
) -> np.ndarray:
    """Derivatives of results by states, from differences of a thousandth of a sigma."""
    columns = []
    for place in range(len(states)):
        step = np.zeros(len(states))
        step[place] = max(_STEP * sigma[place], 1e-15)
        ends = [
            np.array(list(change(dict(zip(states, values + sign * step, strict=True))).values()))
            for sign in (1.0, -1.0)
        ]
        columns.append((ends[0] - ends[1]) / (2.0 * step[place]))
    return np.array(columns).T


def _unit(name: str) -> tuple[str, float]:
    """Unit of a result: its name, and its size in SI."""
    for begin, about in _UNITS.items():
        if name.startswith(begin):
            return about
    if name[:-2] in ("gyro_k", "accel_k"):
        return ("ppm", units.PPM) if name[-1] == name[-2] else ("arcsec", units.ARCSEC)
    key = key_of(next(g.source for g in AUGMENTATIONS.values() if name in g.names))
    return unit_text(key), size_of(key)[1]


def content(found: Calibrated) -> dict[str, Any]:
    """What was found, as it is written."""
    rests = [part for part in found.outcome.parts if not part.turns]
    interval = found.record.interval
    return {
        "parameter": found.parameter,
        "unit": found.unit,
        "estimate": found.estimate.tolist(),
        "std": found.std.tolist(),
        "given": found.given,
        "dwells": len(rests),
        "from_s": [part.first * interval for part in rests],
        "to_s": [part.end * interval for part in rests],
        "innovation_ratio": float(found.outcome.calibration.innovation_ratio[0]),
        "passes": int(found.outcome.calibration.passes[0]),
    }


def compensation(found: Calibrated) -> str:
    """Text of a compensation file: parameters of the sensor model in paper units, YAML."""
    about = found.outcome
    names = [*NAMES, *about.estimator.augmented_names]
    values = np.concatenate([about.estimate, about.augmented])
    named = [_unit(name) for name in names]
    rows = [
        (name, value / size, unit)
        for name, value, (unit, size) in zip(names, values, named, strict=True)
    ]
    return render(_TEMPLATES, "compensation.yaml.jinja", log=found.header.data, rows=rows)


def page(found: Calibrated, config: Config) -> str:
    """One page on a calibrated log."""
    data = content(found)
    turns = [part for part in found.outcome.parts if part.turns]
    return render(
        _TEMPLATES,
        "calibration.md.jinja",
        log=found.header.data,
        header=found.header,
        frame=config.calibration.frame,
        noise=config.noise.name,
        duration=found.record.duration,
        rate=1.0 / found.record.interval,
        turns=len(turns),
        **{key: data[key] for key in ("dwells", "innovation_ratio", "passes")},
        rows=rows(found),
        not_given=[n for n, given in zip(found.parameter, found.given, strict=True) if not given],
    )


def rows(found: Calibrated) -> list[tuple[str, str, str, str]]:
    """Parameter, unit, estimate and sigma in words."""
    return [
        (name, unit, f"{value:.5g}", f"{std:.2g}" if given else "not given")
        for name, unit, value, std, given in zip(
            found.parameter, found.unit, found.estimate, found.std, found.given, strict=True
        )
    ]
