"""Two calibrations of one unit: of both halves of a log, or of two logs."""

import itertools
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from inscal.chance import too_long_p
from inscal.estimator import initial_constants
from inscal.parameters import NAMES
from inscal.record_filter import rough_path
from inscal.record_tests import Trace, Traces, difference_covariance, likeness, traces_of
from inscal.recorded import Stretch
from inscal.response import response
from inscal.suspects import DRIFT, WANDERING, Span, suspects, wander_covariance
from pipeline.config.disturbance import key_of, size_of, unit_text
from pipeline.config.schema import Config
from pipeline.console.errors import DataError
from pipeline.console.output import json_data
from pipeline.logs.calibration import Calibrated, Log, calibrated, constants_of, unit_of

_SAMPLE = 0.05
"""In turns, s: at 10 deg/s half a degree, which a trace does not feel."""
_LIKELIER = 3.0
"""Logarithm of the likelihood ratio from which a suspect is named: 20."""
_SAME = 1e-9
"""Share of a difference's variance, in units of its sigmas, below which it is rounding."""


@dataclass(frozen=True)
class Like:
    """A suspect that a difference looks like.

    Attributes
    ----------
    name : str
    size : float
        Its likeliest size.
    unit : str
        Of it.
    log_ratio : float
        Logarithm of how much likelier the difference is with it.
    """

    name: str
    size: float
    unit: str
    log_ratio: float


@dataclass(frozen=True)
class Pair:
    """Difference of two calibrations.

    Attributes
    ----------
    names : list of str
        Parameters that both give.
    difference : ndarray, shape (n,)
    covariance : ndarray, shape (n, n)
        Of it.
    moved : callable
        Makes what constants of each suspect do to the difference: dict of ndarray, shape (n, m).
    """

    names: list[str]
    difference: np.ndarray
    covariance: np.ndarray
    moved: Callable[[], dict[str, np.ndarray]]

    def tests(self) -> list[tuple[str, float, float, float]]:
        """Name, chi-square, degrees of freedom and p-value: of all together, then one by one."""
        sigma = np.sqrt(np.diag(self.covariance))
        values, vectors = np.linalg.eigh(self.covariance / np.outer(sigma, sigma))
        free = values > _SAME
        whitened = (vectors.T @ (self.difference / sigma))[free] / np.sqrt(values[free])
        every = [("all", float(whitened @ whitened), float(free.sum()))]
        squared = np.square(self.difference / sigma)
        every += [(name, float(x), 1.0) for name, x in zip(self.names, squared, strict=True)]
        return [(name, total, dof, float(too_long_p(total, dof))) for name, total, dof in every]

    def alike(self, wander_time: float, duration: float) -> list[Like]:
        """Suspects that look like the difference, those that look most like it first.

        Parameters
        ----------
        wander_time : float
            Correlation time of what wanders, s.
        duration : float
            Of the record, s.
        """
        out = []
        for name, moved in self.moved().items():
            variance = np.ones(moved.shape[1])
            if name in WANDERING:
                variance = wander_covariance(1.0, wander_time, duration)
            ratio, size = likeness(self.difference, self.covariance, moved, variance)
            if ratio > _LIKELIER:
                unit, si = unit_of_suspect(name)
                out.append(Like(name, size / si, unit, ratio))
        return sorted(out, key=lambda one: -one.log_ratio)


def traces_in(found: Calibrated, span: Span | None = None) -> Traces:
    """Traces of all suspects in the last pass over a log.

    Parameters
    ----------
    found : Calibrated
    span : Span, optional
        Place of the log in a longer one.

    Returns
    -------
    Traces
    """
    outcome, belief = found.outcome, found.log.belief
    path = rough_path(found.log.record, outcome, _SAMPLE)
    made = response(path, belief.update_interval)
    suspected = suspects(path, made, belief.model, span)
    return traces_of(outcome.estimator, outcome.last_pass, outcome.transitions, belief, suspected)


def halves_of(found: Calibrated, config: Config) -> Pair:
    """Calibrate both halves of a log, cut in the middle of its middle rest.

    Parameters
    ----------
    found : Calibrated
        The whole log.
    config : Config

    Returns
    -------
    Pair
        The second half less the first.

    Raises
    ------
    DataError
        If a half cannot be calibrated.
    """
    log = found.log
    samples = round(log.belief.update_interval / log.record.interval)
    if len(log.rests) < 3:
        raise DataError(f"{log.name}: {len(log.rests)} rests are too few for two halves")
    middle = log.rests[len(log.rests) // 2]
    cut = round((middle.first + middle.end) / 2 / samples) * samples
    whole = len(log.record.angle)
    ends = [(0, cut), (cut, whole)]
    parts = [_part(log, *end) for end in ends]
    both = [calibrated(part, config) for part in parts]
    kept = np.array([a and b for a, b in zip(both[0].given, both[1].given, strict=True)])
    own = constants_of(found.outcome)
    covariances = [one.outcome.estimator.first.covariance[np.ix_(own, own)] for one in both]
    prior = initial_constants(both[0].outcome.transitions, log.belief.prior)[own]
    slope = found.slope[kept]
    spread = difference_covariance(covariances[0], covariances[1], prior)

    def moved() -> dict[str, np.ndarray]:
        spans = [Span(first * log.record.interval, log.record.duration) for first, _ in ends]
        first, second = (traces_in(one, at).suspects for one, at in zip(both, spans, strict=True))
        return {name: slope @ (second[name].moved - first[name].moved)[own] for name in first}

    names = list(itertools.compress(found.parameter, kept))
    return Pair(names, (both[1].estimate - both[0].estimate)[kept], slope @ spread @ slope.T, moved)


def _part(log: Log, first: int, end: int) -> Log:
    """Samples of a log as a log."""
    parts = []
    for part in log.parts:
        begin, stop = max(part.first, first), min(part.end, end)
        if begin < stop:
            parts.append(Stretch(begin - first, stop - first, part.turns))
    return replace(log, record=log.record.part(first, end), parts=parts)


def beside(found: Calibrated, path: str) -> Pair:
    """A calibration beside the result of another one of the same unit.

    Parameters
    ----------
    found : Calibrated
    path : str
        What the stage wrote of the other one, JSON.

    Returns
    -------
    Pair
        This one less the other.

    Raises
    ------
    DataError
        If it is no such file, or of other units.
    """
    other = _read(path)
    theirs = {name: place for place, name in enumerate(other["parameter"]) if other["given"][place]}
    ours = [
        place for place, name in enumerate(found.parameter) if found.given[place] and name in theirs
    ]
    names = [found.parameter[place] for place in ours]
    places = [theirs[name] for name in names]
    for here, there in zip(ours, places, strict=True):
        if found.unit[here] != other["unit"][there]:
            raise DataError(
                f"calibration.compare_to = {path}: {found.parameter[here]} is in "
                f"{other['unit'][there]}, not {found.unit[here]}"
            )
    if not names:
        raise DataError(f"calibration.compare_to = {path}: gives no parameter that this log gives")
    spread = np.asarray(other["covariance"])[np.ix_(places, places)]
    own = constants_of(found.outcome)

    def moved() -> dict[str, np.ndarray]:
        made: dict[str, Trace] = traces_in(found).suspects
        return {name: found.slope[ours] @ one.moved[own] for name, one in made.items()}

    return Pair(
        names,
        found.estimate[ours] - np.asarray(other["estimate"])[places],
        difference_covariance(found.covariance[np.ix_(ours, ours)], spread, None),
        moved,
    )


def _read(path: str) -> dict[str, Any]:
    """Result of a calibration; without a covariance it has that of its sigmas."""
    try:
        found = json_data(Path(path).read_text(encoding="utf-8"))
        count = len(found["parameter"])
        for key in ("unit", "estimate", "std", "given"):
            if len(found[key]) != count:
                raise ValueError(key)
        found.setdefault("covariance", np.diag(np.square(found["std"])))
        if np.asarray(found["covariance"], dtype=float).shape != (count, count):
            raise ValueError("covariance")
    except FileNotFoundError:
        raise DataError(f"calibration.compare_to = {path}: not found") from None
    except (OSError, UnicodeError, json.JSONDecodeError, KeyError, TypeError, ValueError):
        raise DataError(
            f"calibration.compare_to = {path}: must be what this stage wrote, JSON"
        ) from None
    return dict(found)


def unit_of_suspect(name: str) -> tuple[str, float]:
    """Unit of a suspect's size: its name, and its size in SI."""
    if name.removesuffix(DRIFT) in NAMES:
        return unit_of(name.removesuffix(DRIFT))
    key = key_of(name)
    return unit_text(key), size_of(key)[1]
