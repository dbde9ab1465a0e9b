"""A recorded unit calibrated: the filter of campaigns on the motion that its own record shows.

Gains, passes and the compiled loop are those of simulated campaigns. What differs is where the
motion comes from (`inscal.recorded`): its linear model is taken step by step from the response of
navigation to apparent increments, and is made anew from compensated increments, some rounds. All
lanes of the loop hold the same record.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import expm

from inscal import sensor
from inscal.augmentation import augment
from inscal.calibrator import Calibration, calibrate, empty_history
from inscal.estimator import Belief, Estimator, estimator_of
from inscal.innovations import whiten
from inscal.kernel import LANES
from inscal.motion import Site, motion_of
from inscal.path import Path
from inscal.record import OBSERVED, Record
from inscal.recorded import (
    Increments,
    RecordedPath,
    Stretch,
    aligned,
    coarser,
    compensated,
    steps_of_record,
)
from inscal.response import Response, of_parameters, response
from inscal.state_model import Transitions, navigation_dynamics, noise_of

_UNKNOWN = 1e9  # m/s and m: a standard deviation of what is not observed


@dataclass(frozen=True)
class Outcome:
    """What a record says of its unit.

    Attributes
    ----------
    calibration : Calibration
        Of `LANES` equal lanes.
    estimator : Estimator
        Its covariance is that of the estimates.
    transitions : Transitions
        Of the filter, augmented states included.
    path : Path
        As the record shows it.
    parts : sequence of Stretch
        Rests and turns.
    unit : ndarray, shape (updates, OBSERVED)
        Innovations of the last pass, whitened.
    seen : ndarray of bool, shape (updates, OBSERVED)
        Innovations that are to be normal ones if the filter is right.
    """

    calibration: Calibration
    estimator: Estimator
    transitions: Transitions
    path: Path
    parts: Sequence[Stretch]
    unit: np.ndarray
    seen: np.ndarray

    @property
    def estimate(self) -> np.ndarray:
        """The 27 parameters, SI."""
        return self.calibration.estimate[:, 0]

    @property
    def last_pass(self) -> int:
        """Number of the last pass, from 0."""
        return int(self.calibration.passes[0]) - 1

    @property
    def augmented(self) -> np.ndarray:
        """Augmented states that do not wander, SI."""
        return self.calibration.augmented[:, 0]


def rough_path(record: Increments, outcome: Outcome, longest: float) -> RecordedPath:
    """The path that a calibrated record shows, in turns by longer samples.

    Parameters
    ----------
    record : Increments
        That of the outcome.
    outcome : Outcome
    longest : float
        Sample, s.

    Returns
    -------
    RecordedPath
    """
    about, interval = outcome.path, outcome.transitions.interval
    better, parts = coarser(compensated(record, outcome.estimate), outcome.parts, interval, longest)
    steps, _ = steps_of_record(better, parts, about.steps.attitude[0], about.site, interval)
    return RecordedPath(steps, motion_of(steps, about.site), about.site)


def transitions_of_path(path: Path, belief: Belief, made: Response) -> Transitions:
    """Linear model of a path in steps, about the motion that it has.

    Parameters
    ----------
    path : Path
    belief : Belief
    made : Response
        Of the path.

    Returns
    -------
    Transitions
        Of the belief's model, without augmented states.
    """
    dynamics, interval = navigation_dynamics(path.site), belief.update_interval
    columns = of_parameters(made, path, belief.model.columns)
    return Transitions(
        navigation=expm(dynamics * interval),
        parameter=columns,
        index=np.arange(len(columns)),
        noise=noise_of(dynamics, belief.noise, interval),
        dynamics=dynamics,
        interval=interval,
    )


def calibrate_record(
    record: Increments,
    parts: Sequence[Stretch],
    site: Site,
    belief: Belief,
    *,
    rounds: int = 3,
    at_rest: bool = False,
    left_out: Sequence[int] = (),
) -> Outcome:
    """Calibrate a unit that stayed at one place.

    Parameters
    ----------
    record : Increments
        A whole number of updates long.
    parts : sequence of Stretch
        Its rests and turns.
    site : Site
    belief : Belief
    rounds : int
        How often the motion is taken from the record: from what is reported, and then from what is
        compensated.
    at_rest : bool
        Whether all that is known is that it has no velocity in its rests; else its position and
        velocity are known at all times.
    left_out : sequence of int
        Rests during which nothing is observed, from 0.

    Returns
    -------
    Outcome

    Raises
    ------
    ValueError
        If the record begins with a turn, or is no whole number of updates long.
    """
    if parts[0].turns:
        raise ValueError("the record begins with a turn; it must begin at rest")
    outcome = None
    for _ in range(rounds):
        # of a long log all that is kept of a round is its estimate: the rest is half a gigabyte
        estimate, outcome = None if outcome is None else outcome.estimate, None
        path, first = _path(record, estimate, parts, site, belief.update_interval)
        observed = _observed(path, belief, at_rest, left_out)
        outcome = _calibrate(record, first, path, parts, belief, observed)
    assert outcome is not None
    return outcome


def _path(
    record: Increments,
    estimate: np.ndarray | None,
    parts: Sequence[Stretch],
    site: Site,
    update_interval: float,
) -> tuple[RecordedPath, np.ndarray]:
    """Path that a record shows once compensated by an estimate, and first samples of its steps."""
    better = record if estimate is None else compensated(record, estimate)
    attitude = aligned(better, parts[0], site)
    steps, first = steps_of_record(better, parts, attitude, site, update_interval)
    return RecordedPath(steps, motion_of(steps, site), site), first


def _calibrate(
    record: Increments,
    first: np.ndarray,
    path: Path,
    parts: Sequence[Stretch],
    belief: Belief,
    observed: np.ndarray | None,
) -> Outcome:
    made = response(path, belief.update_interval)
    augmented = augment(belief.model, belief.augmented, path, belief.update_interval, made)
    transitions = transitions_of_path(path, belief, made)
    estimator = estimator_of(transitions, belief, augmented, observed)
    if augmented is not None:
        transitions = replace(transitions, augmented=augmented.transitions)
    reported = np.concatenate(
        [np.add.reduceat(x, first, axis=0) for x in (record.angle, record.velocity)], axis=1
    )
    lanes = Record(
        sensors=_lanes(reported),
        observations=_lanes(_observations(record, path.motion.updates)),
        attitude=_lanes(path.steps.attitude[0]),
        velocity=np.zeros((3, LANES)),
        position=np.zeros((3, LANES)),
    )
    history = empty_history(estimator.max_passes, path.motion.updates, estimates=False)
    found = calibrate(lanes, path.motion, path.site, estimator, history=history)
    number = int(found.passes[0]) - 1
    innovation = history.innovation[number, :, :, :1]
    unit = whiten(innovation, estimator.gains(number).innovation_covariance)[..., 0]
    seen = np.ones(unit.shape, dtype=bool) if observed is None else observed < _UNKNOWN
    if record.observed is None:  # known positions have no noise, and add nothing to velocities
        seen[:, 3:] = False
    return Outcome(found, estimator, transitions, path, parts, unit, seen)


def _observations(record: Increments, updates: int) -> np.ndarray:
    if record.observed is None:
        return np.zeros((updates, OBSERVED))
    samples = len(record.angle) // updates
    return record.observed[samples - 1 :: samples]


def _observed(
    path: Path, belief: Belief, at_rest: bool, left_out: Sequence[int]
) -> np.ndarray | None:
    """Standard deviations of observations, None where they are those of the belief."""
    if not at_rest and not left_out:
        return None
    turn, begin = path.steps.turn, path.steps.update_step[:-1]
    turning = np.add.reduceat(turn >= 0, begin) > 0
    rest = np.maximum.accumulate(turn)[begin] + 1  # of an update: as many turns came before
    out = np.repeat([belief.noise.velocity, belief.noise.position], 3)
    out = np.tile(out, (len(begin), 1))
    if at_rest:
        out[turning], out[:, 3:] = _UNKNOWN, _UNKNOWN
    out[np.isin(rest, left_out)] = _UNKNOWN
    return out


def _lanes(values: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(np.broadcast_to(values[..., None], (*values.shape, LANES)))


def forces_at_rest(
    record: Increments, parts: Sequence[Stretch], parameters: np.ndarray
) -> np.ndarray:
    """Mean specific force of each rest, compensated by all 27 parameters.

    Parameters
    ----------
    record : Increments
    parts : sequence of Stretch
        Of the record.
    parameters : ndarray, shape (27,)
        SI.

    Returns
    -------
    ndarray, shape (rests, 3)
        m/s^2, body axes: of the length of gravity where all is right.
    """
    out = []
    for part in parts:
        if not part.turns:
            angle, velocity = (
                x[part.first : part.end].mean(axis=0) for x in (record.angle, record.velocity)
            )
            both = sensor.compensate(
                parameters[:, None], 0, tuple(angle), tuple(velocity), record.interval
            )
            out.append(np.array(both[1]) / record.interval)
    return np.array(out)
