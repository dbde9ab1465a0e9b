"""One calibration experiment: truth on one side, an estimator on the other, runs in between.

`Experiment` is all that the runs of a campaign share; `run` turns run numbers into outcomes. The
outcome of a run depends on the experiment and its number alone, to the last bit: not on which other
runs went with it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inscal.calibrator import History, calibrate, empty_history
from inscal.estimator import Estimator
from inscal.kernel import LANES
from inscal.motion import Motion, Site
from inscal.parameters import COUNT
from inscal.recursion import InitialStd
from inscal.simulation import TruthModel, Workspace, draw_truth, simulate
from inscal.state_model import NoiseModel
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
    numbers = list(runs)
    workspace = workspace or Workspace.of(experiment.motion)
    truth = np.array([draw_truth(experiment.truth, experiment.seed, r) for r in numbers])
    estimate = np.empty((len(numbers), COUNT))
    for first in range(0, len(numbers), LANES):
        part = slice(first, min(first + LANES, len(numbers)))
        estimate[part] = _tile(experiment, numbers[part], truth[part], workspace)
    failed = np.logical_not(np.isfinite(estimate).all(axis=1))
    estimate[failed] = np.nan
    modelled = experiment.estimator.predicted_std > 0
    covariance = experiment.estimator.parameter_covariance[np.ix_(modelled, modelled)]
    consistency = np.full(len(numbers), np.nan)
    if not failed.all():
        consistency[~failed] = nees((estimate - truth)[~failed][:, modelled], covariance)
    return Outcome(truth, estimate, consistency, failed)


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
    outcome = run(experiment, [number])
    full = empty_history(experiment.estimator.passes, experiment.motion.updates)
    workspace = Workspace.of(experiment.motion)
    _tile(experiment, [number], outcome.truth, workspace, history=full)
    return outcome, History(full.estimate[..., :1], full.innovation[..., :1])


def _tile(experiment, numbers, truth, workspace, history=None) -> np.ndarray:
    """Estimates, shape (runs, 27), of up to `LANES` runs; spare lanes repeat the last one."""
    lanes = np.minimum(np.arange(LANES), len(numbers) - 1)
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
    return estimate.T[: len(numbers)]
