"""One calibration experiment: truth on one side, an estimator on the other, runs in between.

`Experiment` is all that the runs of a campaign share; `run` turns run numbers into outcomes. The
outcome of a run depends on the experiment and its number alone, to the last bit: not on which other
runs went with it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from inscal.calibrator import History, calibrate, empty_history
from inscal.estimator import Estimator, build_estimator
from inscal.kernel import LANES
from inscal.motion import Motion, Site, build_motion
from inscal.parameters import COUNT
from inscal.recursion import InitialStd
from inscal.schedule import Schedule
from inscal.simulation import TruthModel, Workspace, draw_truth, simulate
from inscal.state_model import NoiseModel, StateModel
from inscal.statistics import nees


@dataclass(frozen=True)
class Experiment:
    """What the runs of a campaign share.

    Attributes
    ----------
    seed : int
    site : Site
    motion : Motion
    truth : TruthModel
        Distribution of the true parameters.
    noise : NoiseModel
        True noise.
    initial : InitialStd
        True spread of the initial attitude, velocity and position errors.
    estimator : Estimator
        What the filter believes.
    """

    seed: int
    site: Site
    motion: Motion
    truth: TruthModel
    noise: NoiseModel
    initial: InitialStd
    estimator: Estimator


def prepare(
    seed: int,
    schedule: Schedule,
    site: Site,
    noise: NoiseModel,
    initial: InitialStd,
    truth: TruthModel,
    *,
    model: StateModel | None = None,
    passes: int,
    update_interval: float,
    dwell_step: float,
    turn_step: float,
) -> Experiment:
    """Experiment whose filter is right about noise and initial errors; computes the gains.

    Parameters
    ----------
    seed : int
    schedule : Schedule
    site : Site
    noise : NoiseModel
        Of the sensors and observations, and what the filter believes of them.
    initial : InitialStd
        Spread of the initial errors, and the filter's prior.
    truth : TruthModel
        Distribution of the true parameters.
    model : StateModel, optional
        What the filter estimates; all parameters if not given.
    passes : int
    update_interval, dwell_step, turn_step : float
        s.

    Returns
    -------
    Experiment

    Raises
    ------
    ValueError
        If the schedule is not a whole number of update intervals long, or a turn does not fit.
    """
    return Experiment(
        seed=seed,
        site=site,
        motion=build_motion(
            schedule,
            site,
            update_interval=update_interval,
            dwell_step=dwell_step,
            turn_step=turn_step,
        ),
        truth=truth,
        noise=noise,
        initial=initial,
        estimator=build_estimator(
            schedule,
            site,
            model or StateModel(),
            noise,
            initial,
            update_interval=update_interval,
            passes=passes,
        ),
    )


@dataclass(frozen=True)
class Outcome:
    """Results of some runs, SI.

    Attributes
    ----------
    truth, estimate : ndarray, shape (runs, 27)
    nees : ndarray, shape (runs,)
        Normalised estimation error squared over the modelled parameters.
    failed : ndarray of bool, shape (runs,)
        Runs that diverged; their estimates and NEES are NaN.
    """

    truth: np.ndarray
    estimate: np.ndarray
    nees: np.ndarray
    failed: np.ndarray


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
    truth, estimate = np.empty((len(runs), COUNT)), np.empty((len(runs), COUNT))
    for part, true, estimated in tiles(experiment, runs, workspace):
        truth[part], estimate[part] = true, estimated
    return _outcome(experiment.estimator, truth, estimate)


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
    full = empty_history(experiment.estimator.passes, experiment.motion.updates)
    [(_, truth, estimate)] = tiles(experiment, [number], history=full)
    history = History(full.estimate[..., :1], full.innovation[..., :1])
    return _outcome(experiment.estimator, truth, estimate), history


def tiles(
    experiment: Experiment,
    runs: Sequence[int],
    workspace: Workspace | None = None,
    *,
    history: History | None = None,
) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
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
    truth, estimate : ndarray, shape (runs of the part, 27)
        SI; estimates are not finite where a run diverged.
    """
    workspace = workspace or Workspace.of(experiment.motion)
    for first in range(0, len(runs), LANES):
        numbers = [int(number) for number in runs[first : first + LANES]]
        used = len(numbers)
        truth = np.array([draw_truth(experiment.truth, experiment.seed, r) for r in numbers])
        lanes = np.minimum(np.arange(LANES), used - 1)  # spare lanes repeat the last run
        record = simulate(
            truth[lanes].T,
            experiment.motion,
            experiment.noise,
            experiment.initial,
            seed=experiment.seed,
            runs=[numbers[lane] for lane in lanes],
            workspace=workspace,
        )
        estimate = calibrate(
            record, experiment.motion, experiment.site, experiment.estimator, history=history
        )
        yield slice(first, first + used), truth, estimate.T[:used]


def _outcome(estimator: Estimator, truth: np.ndarray, estimate: np.ndarray) -> Outcome:
    """Judge the estimates of some runs, shapes (runs, 27)."""
    failed = np.logical_not(np.isfinite(estimate).all(axis=1))
    estimate = np.where(failed[:, None], np.nan, estimate)
    modelled = estimator.predicted_std > 0
    consistency = np.full(len(truth), np.nan)
    if not failed.all():
        covariance = estimator.parameter_covariance[np.ix_(modelled, modelled)]
        consistency[~failed] = nees((estimate - truth)[~failed][:, modelled], covariance)
    return Outcome(truth, estimate, consistency, failed)
