"""What a dask worker does: one batch of runs.

A module of its own, so that workers import it by name and keep their buffers from batch to batch.
"""

import logging
import threading
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from inscal.convergence import RAISED
from inscal.experiment import Experiment, Outcome, run
from inscal.parameters import COUNT
from inscal.simulation import Workspace

_thread = threading.local()


def share(experiment: Experiment) -> Experiment:
    """Give the experiment back.

    As the result of a task it is handed from worker to worker and made again if all that held it
    are lost; data scattered to the workers would be lost with them.
    """
    return experiment


def say_nothing_of_cancelled_batches() -> None:
    """Keep a worker process from warning of the batches that an interrupted campaign gives up."""
    logging.getLogger("distributed.worker.state_machine").setLevel(logging.ERROR)


@dataclass(frozen=True)
class Batch:
    """What comes of a batch of runs.

    Attributes
    ----------
    outcome : Outcome
    exceptions : dict of int to str
        What was raised, by the number of the run that it ended.
    """

    outcome: Outcome
    exceptions: dict[int, str]


def attempt(experiment: Experiment, runs: list[int]) -> Batch:
    """Make a batch of runs; an exception costs the run it comes from and no other.

    Parameters
    ----------
    experiment : Experiment
    runs : list of int

    Returns
    -------
    Batch
    """
    workspace = getattr(_thread, "workspace", None)
    if workspace is None or not workspace.fits(experiment.motion):
        workspace = _thread.workspace = Workspace.of(experiment.motion)
    try:
        return Batch(run(experiment, runs, workspace), {})
    except Exception as error:
        if len(runs) == 1:
            augmented = len(experiment.estimator.augmented_names)
            return Batch(_nothing(augmented), {runs[0]: f"{type(error).__name__}: {error}"})
    return joined([attempt(experiment, [number]) for number in runs])


def _nothing(augmented: int) -> Outcome:
    """Outcome of one run that an exception ended."""
    row, nan = np.full((1, COUNT), np.nan), np.full(1, np.nan)
    further = np.full((1, augmented), np.nan)
    failed, no_passes = np.ones(1, dtype=bool), np.zeros(1, dtype=np.int64)
    return Outcome(row, row, further, further, nan, failed, no_passes, np.full(1, RAISED), nan)


def joined(batches: Sequence[Batch]) -> Batch:
    """Several batches as one."""
    every = [batch.outcome for batch in batches]
    columns = (np.concatenate([getattr(one, f.name) for one in every]) for f in fields(Outcome))
    raised = {number: text for batch in batches for number, text in batch.exceptions.items()}
    return Batch(Outcome(*columns), raised)
