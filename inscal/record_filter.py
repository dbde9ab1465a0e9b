"""A recorded unit calibrated: the filter of campaigns on the motion that its own record shows.

Gains, passes and the compiled loop are those of simulated campaigns. What differs is where the
motion comes from (`inscal.recorded`): its linear model is taken step by step from the response of
navigation to apparent increments, and is made anew from compensated increments, some rounds. All
lanes of the loop hold the same record.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from inscal import sensor
from inscal.augmentation import augment
from inscal.calibrator import Calibration, calibrate
from inscal.estimator import Belief, Estimator, estimator_of
from inscal.kernel import LANES
from inscal.motion import Site, motion_of
from inscal.path import Path
from inscal.record import OBSERVED, Record
from inscal.recorded import (
    Increments,
    RecordedPath,
    Stretch,
    aligned,
    steps_of_record,
)
from inscal.response import Response, response
from inscal.state_model import (
    StateModel,
    Transitions,
    navigation_dynamics,
    noise_of,
    parameter_dynamics,
)

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
    path : Path
        As the record shows it.
    parts : sequence of Stretch
        Rests and turns.
    """

    calibration: Calibration
    estimator: Estimator
    path: Path
    parts: Sequence[Stretch]

    @property
    def estimate(self) -> np.ndarray:
        """The 27 parameters, SI."""
        return self.calibration.estimate[:, 0]

    @property
    def augmented(self) -> np.ndarray:
        """Augmented states that do not wander, SI."""
        return self.calibration.augmented[:, 0]


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
    columns = made.by_update(parameter_increments(path, belief.model))
    return Transitions(
        navigation=expm(dynamics * interval),
        parameter=columns,
        index=np.arange(len(columns)),
        noise=noise_of(dynamics, belief.noise, interval),
        dynamics=dynamics,
        interval=interval,
    )


def parameter_increments(path: Path, model: StateModel) -> np.ndarray:
    """Apparent increments of one unit of each modelled parameter, shape (n, steps, 6), rad, m/s."""
    motion, duration = path.motion, path.steps.duration[:, None]
    rates = parameter_dynamics(np.eye(3), motion.angle / duration, motion.velocity / duration)
    # the dynamics are those of navigation errors; what is reported lacks what compensation adds
    angle, velocity = -rates[:, :3], rates[:, 3:6]
    both = np.concatenate([angle, velocity], axis=1) * duration[:, None]
    return both[:, :, model.columns].transpose(2, 0, 1)


def calibrate_record(
    record: Increments,
    parts: Sequence[Stretch],
    site: Site,
    belief: Belief,
    *,
    rounds: int = 3,
    at_rest: bool = False,
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

    Returns
    -------
    Outcome

    Raises
    ------
    ValueError
        If the record begins with a turn, or is no whole number of updates long.
    """
    start = parts[0]
    if start.turns:
        raise ValueError("the record begins with a turn; it must begin at rest")
    better, outcome = record, None
    for _ in range(rounds):
        attitude = aligned(better, start, site)
        steps, first = steps_of_record(better, parts, attitude, site, belief.update_interval)
        path = RecordedPath(steps, motion_of(steps, site), site)
        outcome = _calibrate(record, first, path, parts, belief, at_rest)
        better = compensated(record, outcome)
    assert outcome is not None
    return outcome


def _calibrate(
    record: Increments,
    first: np.ndarray,
    path: Path,
    parts: Sequence[Stretch],
    belief: Belief,
    at_rest: bool,
) -> Outcome:
    made = response(path, belief.update_interval)
    augmented = augment(belief.model, belief.augmented, path, belief.update_interval, made)
    observed = _at_rest(path, belief) if at_rest else None
    estimator = estimator_of(transitions_of_path(path, belief, made), belief, augmented, observed)
    reported = np.concatenate(
        [np.add.reduceat(x, first, axis=0) for x in (record.angle, record.velocity)], axis=1
    )
    lanes = Record(
        sensors=_lanes(reported),
        observations=np.zeros((path.motion.updates, OBSERVED, LANES)),
        attitude=_lanes(path.steps.attitude[0]),
        velocity=np.zeros((3, LANES)),
        position=np.zeros((3, LANES)),
    )
    found = calibrate(lanes, path.motion, path.site, estimator)
    return Outcome(found, estimator, path, parts)


def _at_rest(path: Path, belief: Belief) -> np.ndarray:
    """Standard deviations of observations of which only the velocity at rest is one."""
    turning = np.add.reduceat(path.steps.turn >= 0, path.steps.update_step[:-1]) > 0
    out = np.full((len(turning), OBSERVED), _UNKNOWN)
    out[~turning, :3] = belief.noise.velocity
    return out


def _lanes(values: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(np.broadcast_to(values[..., None], (*values.shape, LANES)))


def compensated(record: Increments, outcome: Outcome) -> Increments:
    """Increments corrected by what was found of the 27 parameters.

    Parameters
    ----------
    record : Increments
    outcome : Outcome

    Returns
    -------
    Increments
    """
    gyro, accel = sensor.matrices(outcome.estimate[:, None])[:, 0]
    bias = outcome.estimate[:6].reshape(2, 3) * record.interval
    return Increments(
        record.interval,
        record.angle @ (np.eye(3) + gyro).T + bias[0],
        record.velocity @ (np.eye(3) + accel).T + bias[1],
    )
