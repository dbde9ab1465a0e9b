"""What a dask worker does: one batch of runs.

A module of its own, so that workers import it by name and keep their buffers from batch to batch.
"""

import logging
import os
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields

import numpy as np

from inscal.convergence import RAISED
from inscal.experiment import Experiment, Outcome, run
from inscal.parameters import COUNT
from inscal.simulation import Workspace

_thread = threading.local()

overdue: list[list[int]] = []
"""Batches of this process that took too long, where it is not to be ended for it."""


def share(experiment: Experiment) -> Experiment:
    """Give the experiment back.

    As the result of a task it is handed from worker to worker and made again if all that held it
    are lost; data scattered to the workers would be lost with them.
    """
    return experiment


def say_nothing() -> None:
    """Keep a worker process quiet of batches that are given up, and of a driver that has ended.

    What becomes of batches and workers is said by the driver.
    """
    for name in ("distributed.worker", "distributed.worker.state_machine", "distributed.core"):
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)


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


@dataclass(frozen=True)
class Limit:
    """How long a batch may take.

    Attributes
    ----------
    seconds : float
    own_process : bool
        Whether the process that computes it is ended then; else the batch is entered in `overdue`.
    """

    seconds: float
    own_process: bool

    @contextmanager
    def over(self, runs: list[int]) -> Iterator[None]:
        """Act if the block lasts too long; a thread cannot be ended, but its process can."""
        watch = threading.Timer(self.seconds, self._end, [runs])
        watch.daemon = True
        watch.start()
        try:
            yield
        finally:
            watch.cancel()

    def _end(self, runs: list[int]) -> None:
        if self.own_process:
            os._exit(1)
        overdue.append(runs)


def attempt(experiment: Experiment, runs: list[int], limit: Limit) -> Batch:
    """Make a batch of runs; whatever is raised costs the run it comes from and no other.

    Parameters
    ----------
    experiment : Experiment
    runs : list of int
    limit : Limit

    Returns
    -------
    Batch
    """
    with limit.over(runs):
        return _attempt(experiment, runs)


def _attempt(experiment: Experiment, runs: list[int]) -> Batch:
    workspace = getattr(_thread, "workspace", None)
    if workspace is None or not workspace.fits(experiment.motion):
        workspace = _thread.workspace = Workspace.of(experiment.motion)
    try:
        return Batch(run(experiment, runs, workspace), {})
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # SystemExit too, which would end a thread that is waited for
        if len(runs) == 1:
            return ended(experiment, runs[0], f"{type(error).__name__}: {error}")
    return joined([_attempt(experiment, [number]) for number in runs])


def ended(experiment: Experiment, number: int, why: str) -> Batch:
    """One run that gave nothing, and why."""
    return Batch(_nothing(len(experiment.estimator.augmented_names)), {number: why})


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
