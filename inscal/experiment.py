"""One calibration experiment: truth on one side, an estimator on the other, runs in between.

`Experiment` is all that the runs of a campaign share; `run` turns run numbers into outcomes. The
outcome of a run depends on the experiment and its number alone, to the last bit: not on which other
runs went with it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from inscal.augmentation import augment
from inscal.calibrator import Calibration, History, calibrate, empty_history
from inscal.convergence import NOT_FINITE
from inscal.disturbance import draw_constants
from inscal.disturbed import Disturbed, disturb, true_noise
from inscal.estimator import Belief, Estimator, build_estimator
from inscal.kernel import LANES
from inscal.motion import Motion, Site
from inscal.parameters import COUNT
from inscal.path import path_of
from inscal.record import Record
from inscal.schedule import Schedule
from inscal.simulation import Truth, Workspace, draw_truth, simulate
from inscal.statistics import nees


@dataclass(frozen=True)
class Experiment:
    """What the runs of a campaign share.

    Attributes
    ----------
    seed : int
    site : Site
    motion : Motion
    truth : Truth
    estimator : Estimator
        What comes of the filter's belief.
    disturbed : Disturbed or None
        What comes of the truth's disturbances; None where there are none.
    """

    seed: int
    site: Site
    motion: Motion
    truth: Truth
    estimator: Estimator
    disturbed: Disturbed | None


def prepare(
    seed: int,
    schedule: Schedule,
    site: Site,
    truth: Truth,
    belief: Belief,
    *,
    dwell_step: float,
    turn_step: float,
) -> Experiment:
    """Experiment on a schedule; computes the motion and the gains.

    Truth and belief know nothing of each other: a filter that is right about the noise has the same
    `NoiseModel` in both.

    Parameters
    ----------
    seed : int
    schedule : Schedule
    site : Site
    truth : Truth
    belief : Belief
        Its update interval is also that of the observations.
    dwell_step, turn_step : float
        Longest steps of the simulation at rest and in turns, s.

    Returns
    -------
    Experiment

    Raises
    ------
    ValueError
        If the schedule is not a whole number of update intervals long, or a turn does not fit.
    """
    path = path_of(
        schedule,
        site,
        update_interval=belief.update_interval,
        dwell_step=dwell_step,
        turn_step=turn_step,
    )
    augmented = augment(belief.model, belief.augmented, path, belief.update_interval)
    return Experiment(
        seed=seed,
        site=site,
        motion=path.motion,
        truth=truth,
        estimator=build_estimator(schedule, site, belief, augmented),
        disturbed=disturb(truth.disturbance, path, belief.update_interval),
    )


@dataclass(frozen=True)
class Outcome:
    """Results of some runs, SI.

    Attributes
    ----------
    truth, estimate : ndarray, shape (runs, 27)
    augmented_truth, augmented_estimate : ndarray, shape (runs, n)
        Of the augmented states that do not wander.
    nees : ndarray, shape (runs,)
        Normalised estimation error squared over the modelled parameters of the 27.
    failed : ndarray of bool, shape (runs,)
        Runs without a result; their estimates and NEES are NaN.
    passes : ndarray of int, shape (runs,)
        Passes made.
    reason : ndarray of int, shape (runs,)
        Why a run failed, a number of `inscal.convergence.REASONS`; 0 where it did not.
    innovation_ratio : ndarray, shape (runs,)
        Mean NIS of an observation; NaN where runs are not judged, or did not converge.
    """

    truth: np.ndarray
    estimate: np.ndarray
    augmented_truth: np.ndarray
    augmented_estimate: np.ndarray
    nees: np.ndarray
    failed: np.ndarray
    passes: np.ndarray
    reason: np.ndarray
    innovation_ratio: np.ndarray


def run(experiment: Experiment, runs: Sequence[int], workspace: Workspace | None = None) -> Outcome:
    """Simulate and calibrate.

    Parameters
    ----------
    experiment : Experiment
    runs : sequence of int
        Run numbers, in any number and order.
    workspace : Workspace, optional
        Buffers to reuse; one thread at a time.

    Returns
    -------
    Outcome
    """
    truth, calibrations = np.empty((len(runs), COUNT)), []
    for part, true, calibration in tiles(experiment, runs, workspace):
        truth[part] = true
        calibrations.append(calibration)
    return _outcome(experiment, runs, truth, calibrations)


def run_with_history(experiment: Experiment, number: int) -> tuple[Outcome, History]:
    """Repeat one run and keep its course.

    Parameters
    ----------
    experiment : Experiment
    number : int
        Run number.

    Returns
    -------
    outcome : Outcome
        Of one run; equal, bit for bit, to the same run's among others.
    history : History
        With one lane.
    """
    [(_, _, calibration)] = tiles(experiment, [number])
    full = empty_history(int(calibration.passes[0]), experiment.motion.updates)
    [(_, truth, calibration)] = tiles(experiment, [number], history=full)
    history = History(full.estimate[..., :1], full.innovation[..., :1])
    return _outcome(experiment, [number], truth, [calibration]), history


def tiles(
    experiment: Experiment,
    runs: Sequence[int],
    workspace: Workspace | None = None,
    *,
    history: History | None = None,
) -> Iterator[tuple[slice, np.ndarray, Calibration]]:
    """Simulate and calibrate runs, up to `LANES` at a time.

    Parameters
    ----------
    experiment : Experiment
    runs : sequence of int
        Run numbers, in any number and order.
    workspace : Workspace, optional
        Buffers to reuse; one thread at a time.
    history : History, optional
        Holds the course of the runs just yielded, in its first lanes, until the next are asked for.

    Yields
    ------
    part : slice
        Of `runs`.
    truth : ndarray, shape (runs of the part, 27)
        SI.
    calibration : Calibration
        A lane per run of the part.
    """
    for part, truth, record in records(experiment, runs, workspace):
        calibration = calibrate(
            record, experiment.motion, experiment.site, experiment.estimator, history=history
        )
        yield part, truth, calibration.head(len(truth))


def records(
    experiment: Experiment, runs: Sequence[int], workspace: Workspace | None = None
) -> Iterator[tuple[slice, np.ndarray, Record]]:
    """Simulate runs, up to `LANES` at a time.

    Parameters
    ----------
    experiment : Experiment
    runs : sequence of int
        Run numbers, in any number and order.
    workspace : Workspace, optional
        Buffers to reuse; one thread at a time.

    Yields
    ------
    part : slice
        Of `runs`.
    truth : ndarray, shape (runs of the part, 27)
        SI.
    record : Record
        Its first lanes are those of the part; valid until the next is asked for.
    """
    workspace = workspace or Workspace.of(experiment.motion)
    parameters = experiment.truth.parameters
    for first in range(0, len(runs), LANES):
        numbers = [int(number) for number in runs[first : first + LANES]]
        used = len(numbers)
        truth = np.array([draw_truth(parameters, experiment.seed, r) for r in numbers])
        lanes = np.minimum(np.arange(LANES), used - 1)  # spare lanes repeat the last run
        about, drawn = experiment.truth, [numbers[lane] for lane in lanes]
        record = simulate(
            truth[lanes].T,
            experiment.motion,
            true_noise(about.noise, about.disturbance),
            about.initial,
            seed=experiment.seed,
            runs=drawn,
            workspace=workspace,
        )
        if experiment.disturbed is not None:
            experiment.disturbed.put_into(record, truth[lanes].T, seed=experiment.seed, runs=drawn)
        yield slice(first, first + used), truth, record


def _outcome(
    experiment: Experiment,
    runs: Sequence[int],
    truth: np.ndarray,
    calibrations: Sequence[Calibration],
) -> Outcome:
    """Join the calibrations of some runs, whose true parameters have shape (runs, 27)."""
    estimator = experiment.estimator
    augmented_truth = _augmented_truth(experiment, runs)
    augmented = np.concatenate([c.augmented for c in calibrations], axis=1).T
    estimate = np.concatenate([c.estimate for c in calibrations], axis=1).T
    reason = np.concatenate([c.reason for c in calibrations])
    reason = np.where(np.isfinite(estimate).all(axis=1), reason, NOT_FINITE)
    failed = reason > 0
    estimate = np.where(failed[:, None], np.nan, estimate)
    augmented = np.where(failed[:, None], np.nan, augmented)
    modelled = estimator.predicted_std > 0
    consistency = np.full(len(truth), np.nan)
    if not failed.all():
        covariance = estimator.parameter_covariance[np.ix_(modelled, modelled)]
        consistency[~failed] = nees((estimate - truth)[~failed][:, modelled], covariance)
    passes = np.concatenate([c.passes for c in calibrations])
    ratio = np.concatenate([c.innovation_ratio for c in calibrations])
    return Outcome(
        truth, estimate, augmented_truth, augmented, consistency, failed, passes, reason, ratio
    )


def _augmented_truth(experiment: Experiment, runs: Sequence[int]) -> np.ndarray:
    """True augmented states of some runs: what disturbances have drawn, else zero."""
    estimator, about = experiment.estimator, experiment.truth.disturbance
    groups = [g for g in estimator.augmented.groups if not g.wanders] if estimator.augmented else []
    drawn = [
        draw_constants(about, g.source, len(g.names), seed=experiment.seed, runs=runs).T
        for g in groups
    ]
    return np.concatenate([np.empty((len(runs), 0)), *drawn], axis=1)
