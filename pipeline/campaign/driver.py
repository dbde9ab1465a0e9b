"""Making the runs of a campaign: batches to workers, what comes back to the store."""

import gc
import math
import shlex
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from itertools import islice
from pathlib import Path

import numpy as np
import zarr
from dask.typing import Key
from distributed import Client, as_completed

from inscal.convergence import REASONS
from inscal.experiment import Experiment
from inscal.kernel import LANES
from pipeline.campaign import provenance, store
from pipeline.campaign.cluster import check, client
from pipeline.campaign.lock import writing
from pipeline.campaign.worker import Batch, attempt, share
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.console import interrupts
from pipeline.console.output import complain
from pipeline.console.progress import CampaignProgress

_FLUSH_INTERVAL_S = 2.0
_QUEUED_PER_WORKER = 4
_SHARES = 2
_FIRST_LOOK = 200
_LOOK_GROWTH = 1.2


def batches(pending: np.ndarray, largest: int, threads: Callable[[], int]) -> Iterator[list[int]]:
    """Pending run numbers in batches of consecutive runs.

    Large ones first, since every batch costs its dispatch, and smaller ones towards the end, so
    that no worker is left with much when the others are done.

    Parameters
    ----------
    pending : ndarray of int
        Ascending.
    largest : int
        Most runs of a batch.
    threads : callable
        Gives how many threads work; asked every time, since workers may join at any time.

    Yields
    ------
    list of int
    """
    while len(pending):
        fair = len(pending) / (_SHARES * threads())
        size = min(largest, LANES * math.ceil(fair / LANES))
        stretch = pending[:size]
        batch = stretch[stretch - stretch[0] == np.arange(len(stretch))]
        yield batch.tolist()
        pending = pending[len(batch) :]


def simulate_campaign(config: Config) -> None:
    """Make all runs of a campaign that its store does not hold yet.

    Parameters
    ----------
    config : Config

    Raises
    ------
    DataError
        If the store is another campaign's, or the cluster cannot be had.
    FailedRunsError
        If more of the runs failed than `campaign.max_failed_share` allows.
    """
    check(config.cluster)
    setup = Setup(config)
    experiment = setup.experiment
    complain(setup.linearisation)
    predicted_std = experiment.estimator.predicted_std / setup.unit
    augmented_std = experiment.estimator.augmented_std / setup.augmented_unit
    with writing(config.campaign.store):
        with interrupts.held():
            target = store.open_store(config, predicted_std, augmented_std)
        with (
            provenance.session(config.campaign, config.cluster, lambda: len(store.pending(target))),
            interrupts.telling(lambda: kept_line(config, target)),
        ):
            _make_pending(config, experiment, target)
        store.refuse_failures(config, *store.counts(target))


def kept_line(config: Config, target: zarr.Group) -> str:
    """What an interrupted campaign keeps, and the command that goes on with it."""
    runs = config.campaign.runs
    return (
        f"interrupted: {runs - len(store.pending(target))} of {runs} runs are kept in "
        f"{config.campaign.store}; to go on: {shlex.join(sys.orig_argv)}"
    )


def _make_pending(config: Config, experiment: Experiment, target: zarr.Group) -> None:
    pending = store.pending(target)
    runs, wanted = config.campaign.runs, config.campaign.precision
    gc.freeze()  # a full collection looks at all that was imported, and stops every thread for it
    name = Path(config.campaign.store).name
    with (
        client(config.cluster) if len(pending) else nullcontext() as workers,
        # said here already, for it takes a moment to shut the workers down
        interrupts.telling(lambda: kept_line(config, target)),
        CampaignProgress(runs, runs - len(pending), name) as progress,
    ):
        if workers is None:
            return
        shared = workers.submit(share, experiment, pure=False)
        for limit in [runs] if wanted is None else checkpoints(runs):
            todo = pending[pending < limit]
            pending = pending[pending >= limit]
            _fan_out(config, shared, todo, target, workers, progress)
            if wanted is None:
                continue
            precision, least = store.precision(target, limit)
            if precision < wanted:
                progress.say(
                    f"every RMSE is known to {100 * precision:.1f} %, that of {least} worst: enough"
                )
                break


def _failures(runs: list[int], batch: Batch, seed: int) -> Iterator[str]:
    """Say of every failed run of a batch why it did, and how it is repeated."""
    for place in np.flatnonzero(batch.outcome.failed):
        number = runs[place]
        why = batch.exceptions.get(number, REASONS[batch.outcome.reason[place]])
        yield f"run {number} failed: {why} (seed {seed}); repeat with only_run={number}"


def checkpoints(runs: int) -> list[int]:
    """Numbers of runs after which a campaign looks whether it is precise enough.

    They depend on nothing but the largest number: when a campaign stops is no matter of timing.
    """
    out = [min(_FIRST_LOOK, runs)]
    while out[-1] < runs:
        out.append(min(runs, math.ceil(_LOOK_GROWTH * out[-1])))
    return out


def _fan_out(config, shared, todo, target, workers: Client, progress) -> None:
    """Keep every worker supplied, write what comes back, release it."""
    finished: list[tuple[list[int], Batch]] = []
    flushed = time.monotonic()
    futures = as_completed(with_results=False)
    numbers: dict[Key, list[int]] = {}

    def threads() -> int:
        return max(1, sum(workers.nthreads().values()))

    waiting = batches(todo, config.campaign.batch, threads)

    def supply() -> None:
        wanted = _QUEUED_PER_WORKER * threads()
        for runs in islice(waiting, max(0, wanted - len(numbers))):
            future = workers.submit(attempt, shared, runs, pure=False)
            numbers[future.key] = runs
            futures.add(future)

    def write() -> None:
        store.write(target, config, finished)
        finished.clear()

    try:
        supply()
        for future in futures:
            with interrupts.held():
                runs, batch = numbers.pop(future.key), future.result()
                future.release()
                supply()
                finished.append((runs, batch))
                for line in _failures(runs, batch, config.campaign.seed):
                    progress.say(line)
                if time.monotonic() - flushed > _FLUSH_INTERVAL_S:
                    write()
                    flushed = time.monotonic()
                progress.advance(len(runs))
    finally:  # interrupted or not, nothing finished is lost
        with interrupts.held():
            write()
