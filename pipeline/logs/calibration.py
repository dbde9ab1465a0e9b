"""A log calibrated: estimates with their sigmas, and which parameters it cannot give."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from inscal import units
from inscal.estimator import CONSTANTS, Belief, initial_constants
from inscal.first_guess import composed, first_guess
from inscal.frames import DELAY, in_accelerometer_frame
from inscal.motion import Site
from inscal.parameters import AUGMENTATIONS, COUNT, NAMES
from inscal.record_filter import Outcome, calibrate_record
from inscal.recorded import Increments, Stretch, compensated, whole_updates
from pipeline.config.disturbance import key_of, size_of, unit_text
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.console.errors import DataError
from pipeline.logs.checked import (
    read_increments,
    refuse_unobserved,
    refuse_wrong_log,
    rests_and_turns,
)
from pipeline.logs.header import Header, read_header
from pipeline.logs.planned import refuse_other_schedule

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
class Log:
    """A log as it was read.

    Attributes
    ----------
    header : Header
    record : Increments
        Corrected by the first guess.
    parts : list of Stretch
        Rests and turns.
    site : Site
    belief : Belief
    guess : ndarray, shape (27,)
        First guess of the parameters, SI; zero if there was none.
    """

    header: Header
    record: Increments
    parts: list[Stretch]
    site: Site
    belief: Belief
    guess: np.ndarray

    @property
    def name(self) -> str:
        """For messages."""
        return self.header.data[0]

    @property
    def rests(self) -> list[Stretch]:
        """Rests alone."""
        return [part for part in self.parts if not part.turns]


@dataclass(frozen=True)
class Calibrated:
    """Result of a log.

    Attributes
    ----------
    log : Log
    outcome : Outcome
    parameter, unit : list of str
    estimate, std : ndarray, shape (n,)
        In these units.
    covariance : ndarray, shape (n, n)
        Likewise.
    slope : ndarray, shape (n, c)
        Derivatives of the estimates by the filter's own constants, which are SI.
    given : list of bool
        Whether the log gives the parameter.
    """

    log: Log
    outcome: Outcome
    parameter: list[str]
    unit: list[str]
    estimate: np.ndarray
    std: np.ndarray
    covariance: np.ndarray
    slope: np.ndarray
    given: list[bool]


def read_log(config: Config) -> Log:
    """Read the log of a configuration, and refuse what cannot be right.

    Parameters
    ----------
    config : Config

    Returns
    -------
    Log

    Raises
    ------
    DataError
        If the log cannot be used.
    """
    header, about = read_header(config.log or ""), config.calibration
    site = Site(header.latitude_deg * units.DEGREE, header.height_m)
    belief, name, guess = _belief(config), header.data[0], np.zeros(COUNT)
    try:
        record = whole_updates(read_increments(header), belief.update_interval)
    except ValueError as error:
        raise DataError(f"{name}: {error}") from None
    refuse_unobserved(name, record, belief.update_interval)
    parts = rests_and_turns(name, record)
    if about.first_guess:
        guess = first_guess(record, parts, site)
        record = compensated(record, guess)
    refuse_wrong_log(name, record, parts, site, spin_seen=not about.first_guess)
    refuse_other_schedule(header, record, parts)
    return Log(header, record, parts, site, belief, guess)


def calibrated(log: Log, config: Config) -> Calibrated:
    """Calibrate a log, or a part of one.

    Parameters
    ----------
    log : Log
    config : Config

    Returns
    -------
    Calibrated

    Raises
    ------
    DataError
        If the filter does not converge on it, or rests left out are none of its own.
    """
    about = config.calibration
    left_out = [number - 1 for number in about.left_out]
    if left_out and not (min(left_out) > 0 and max(left_out) < len(log.rests)):
        raise DataError(
            f"{log.name}: calibration.left_out = {about.left_out}: must be rests from 2 to "
            f"{len(log.rests)}"
        )
    try:
        outcome = calibrate_record(
            log.record,
            log.parts,
            log.site,
            log.belief,
            rounds=about.rounds,
            at_rest=log.header.observation == "velocity_at_rest",
            left_out=left_out,
        )
    except ValueError as error:
        raise DataError(f"{log.name}: {error}") from None
    if outcome.calibration.reason[0]:
        raise DataError(
            f"{log.name}: the filter does not converge on this log; are site, noise and "
            "state groups right?"
        )
    return _in_frame(log, outcome, config.calibration.frame)


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


def _in_frame(log: Log, outcome: Outcome, frame: str) -> Calibrated:
    states = [*NAMES, *outcome.estimator.augmented_names]
    own = constants_of(outcome)
    covariance = outcome.estimator.first.covariance[np.ix_(own, own)]
    values = np.concatenate([outcome.estimate, outcome.augmented])
    prior = initial_constants(outcome.transitions, log.belief.prior)[own]

    def change(values: dict[str, float]) -> dict[str, float]:
        whole = with_guess(log, values)
        return whole if frame == "gyro" else in_accelerometer_frame(whole)

    found = change(dict(zip(states, values, strict=True)))
    slope = _slope(change, states, values, np.sqrt(np.diag(covariance)))
    spread = slope @ covariance @ slope.T
    std = np.sqrt(np.diag(spread))
    before = np.sqrt(np.square(slope) @ np.square(prior))
    named = [unit_of(name) for name in found]
    size = np.array([unit for _, unit in named])
    return Calibrated(
        log,
        outcome,
        list(found),
        [name for name, _ in named],
        np.array(list(found.values())) / size,
        std / size,
        spread / np.outer(size, size),
        slope / size[:, None],
        [bool(0.0 < s < KNOWN * p) for s, p in zip(std, before, strict=True)],
    )


def constants_of(outcome: Outcome) -> np.ndarray:
    """Places of parameters and augmented states among the constants of an estimator."""
    return np.delete(np.arange(len(outcome.estimator.per_sigma)), range(COUNT, CONSTANTS))


def with_guess(log: Log, values: dict[str, float]) -> dict[str, float]:
    """What compensates the log's own numbers: the first guess, and what was found after it."""
    if not log.guess.any():
        return values
    whole = composed(log.guess, np.array([values[name] for name in NAMES]))
    return values | dict(zip(NAMES, whole.tolist(), strict=True))


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


def unit_of(name: str) -> tuple[str, float]:
    """Unit of a result: its name, and its size in SI."""
    for begin, about in _UNITS.items():
        if name.startswith(begin):
            return about
    if name[:-2] in ("gyro_k", "accel_k"):
        return ("ppm", units.PPM) if name[-1] == name[-2] else ("arcsec", units.ARCSEC)
    key = key_of(next(g.source for g in AUGMENTATIONS.values() if name in g.names))
    return unit_text(key), size_of(key)[1]
