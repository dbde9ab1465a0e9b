"""What a dask worker does: one batch of runs.

A module of its own, so that workers import it by name and keep their buffers from batch to batch.
"""

import logging
import threading
from dataclasses import fields

import numpy as np

from inscal.convergence import NOT_FINITE
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


def attempt(experiment: Experiment, runs: list[int]) -> Outcome:
    """Outcome of a batch; an exception costs the run it comes from and no other.

    Parameters
    ----------
    experiment : Experiment
    runs : list of int

    Returns
    -------
    Outcome
    """
    workspace = getattr(_thread, "workspace", None)
    if workspace is None or not workspace.fits(experiment.motion):
        workspace = _thread.workspace = Workspace.of(experiment.motion)
    try:
        return run(experiment, runs, workspace)
    except Exception:
        if len(runs) == 1:
            return _nothing()
    return joined([attempt(experiment, [number]) for number in runs])


def _nothing() -> Outcome:
    """Outcome of one run that an exception ended."""
    nothing, nan = np.full((1, COUNT), np.nan), np.full(1, np.nan)
    no_passes, raised = np.zeros(1, dtype=np.int64), np.full(1, NOT_FINITE)
    return Outcome(nothing, nothing, nan, np.ones(1, dtype=bool), no_passes, raised)


def joined(outcomes: list[Outcome]) -> Outcome:
    """Outcomes of some runs as one."""
    return Outcome(
        *(np.concatenate([getattr(o, f.name) for o in outcomes]) for f in fields(Outcome))
    )
