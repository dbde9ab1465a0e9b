"""What speaks against a calibration, with nothing known of the truth: tests of a log."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from inscal.chance import chi_square_p, too_long_p
from inscal.comparison_statistics import holm
from inscal.record_filter import Outcome
from inscal.record_tests import (
    Traces,
    positions,
    scores,
    smallest,
    smallest_wander,
    whiteness,
)
from inscal.suspects import WANDERING, wander_covariance
from pipeline.config.schema import Config
from pipeline.console.errors import DataError
from pipeline.logs.calibration import Calibrated
from pipeline.logs.pairs import Like, Pair, beside, halves_of, traces_in, unit_of_suspect

LAGS = 20
"""Of the autocorrelations, in updates."""
_LEAST = 10  # degrees of freedom of a rest that is judged
_AXES = ("velocity N", "velocity E", "velocity D", "position N", "position E", "position D")


@dataclass(frozen=True)
class Test:
    """One test.

    Attributes
    ----------
    kind : str
        ``whiteness``, ``position``, ``suspect``, ``halves`` or ``other``.
    name : str
        Of what is tested.
    chi_square, dof : float
    p : float
    found : bool
        Whether it speaks against the calibration, at the level of all tests together.
    """

    kind: str
    name: str
    chi_square: float
    dof: float
    p: float
    found: bool = False


@dataclass(frozen=True)
class Evidence:
    """Tests of a log.

    Attributes
    ----------
    tests : list of Test
    findable : dict of str to (float, str) or None
        Smallest size of each suspect that is found, and its unit; None where none is.
    alike : dict of str to list of Like
        Of ``halves`` and ``other``, where they differ.
    no_halves : str or None
        Why halves were not compared, where they were to be.
    ratio : float
        Innovations squared over what the filter expects of them.
    """

    tests: list[Test]
    findable: dict[str, tuple[float, str] | None]
    alike: dict[str, list[Like]]
    no_halves: str | None
    ratio: float

    @property
    def found(self) -> list[Test]:
        """Tests that speak against the calibration, the clearest first."""
        return sorted((one for one in self.tests if one.found), key=lambda one: one.p)


def evidence(found: Calibrated, config: Config) -> Evidence:
    """Test a calibrated log.

    Parameters
    ----------
    found : Calibrated
    config : Config

    Returns
    -------
    Evidence

    Raises
    ------
    DataError
        If the result to compare with cannot be used.
    """
    about, outcome = config.calibration, found.outcome
    traces = traces_in(found)
    tests = [*_of_whiteness(outcome), *_of_positions(traces, found), *_of_suspects(traces, outcome)]
    pairs: dict[str, Pair] = {}
    why = None
    if about.halves and not about.left_out:
        try:
            pairs["halves"] = halves_of(found, config)
        except DataError as error:
            why = str(error)
    if about.compare_to is not None:
        pairs["other"] = beside(found, about.compare_to)
    for kind, pair in pairs.items():
        tests += [Test(kind, *one) for one in pair.tests()]
    level = holm([one.p for one in tests]) <= about.false_alarms
    tests = [replace(one, found=bool(is_found)) for one, is_found in zip(tests, level, strict=True)]
    differ = {one.kind for one in tests if one.found}
    about_wander = about.wander_time_s, found.log.record.duration
    alike = {kind: pair.alike(*about_wander) for kind, pair in pairs.items() if kind in differ}
    alarm = about.false_alarms / len(tests)
    everything = [slice(0, len(outcome.unit))]
    total, dof = positions(traces, outcome.unit[..., None], outcome.seen, everything)
    findable = _findable(traces, found, config, alarm)
    return Evidence(tests, findable, alike, why, float(total[0, 0] / dof[0]))


def _of_whiteness(outcome: Outcome) -> Iterator[Test]:
    totals = whiteness(outcome.unit, outcome.seen, LAGS)
    for name, total in zip(_AXES, totals, strict=False):
        yield Test("whiteness", name, float(total), LAGS, float(too_long_p(total, LAGS)))


def _of_positions(traces: Traces, found: Calibrated) -> Iterator[Test]:
    log, outcome = found.log, found.outcome
    samples = round(log.belief.update_interval / log.record.interval)
    spans = [slice(-(-part.first // samples), part.end // samples) for part in log.rests]
    total, dof = positions(traces, outcome.unit[..., None], outcome.seen, spans)
    for number, (one, freedom) in enumerate(zip(total[:, 0], dof, strict=True), 1):
        if freedom > _LEAST:
            p = float(chi_square_p(one, freedom))
            yield Test("position", str(number), float(one), float(freedom), p)


def _of_suspects(traces: Traces, outcome: Outcome) -> Iterator[Test]:
    for name, total in scores(traces, outcome.unit[..., None]).items():
        dof = traces.suspects[name].dof
        if dof:
            yield Test("suspect", name, float(total[0]), dof, float(too_long_p(total[0], dof)))


def _findable(
    traces: Traces, found: Calibrated, config: Config, level: float
) -> dict[str, tuple[float, str] | None]:
    about, duration = config.calibration, found.log.record.duration
    out: dict[str, tuple[float, str] | None] = {}
    for name, trace in traces.suspects.items():
        unit, si = unit_of_suspect(name)
        if name in WANDERING:
            variance = wander_covariance(1.0, about.wander_time_s, duration)
            size = smallest_wander(trace, variance, level, about.power)
        else:
            every = smallest(trace, level, about.power)
            size = float(every[np.isfinite(every)].max(initial=0.0)) or np.inf
        out[name] = (size / si, unit) if np.isfinite(size) else None
    return out
