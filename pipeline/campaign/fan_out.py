"""Batches to workers, and what comes back to the store, whatever happens to a worker.

A batch whose worker process ends is split until the run that ends it is found. What other batches
were queued on that worker is as suspect, so all of them wait until nothing else is left to do, and
then go one at a time: whose worker ends then is known.
"""

import math
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from dataclasses import dataclass, field, replace

import numpy as np
import zarr
from distributed import Client, Future, KilledWorker, wait

from inscal.convergence import REASONS
from inscal.experiment import Experiment
from inscal.kernel import LANES
from pipeline.campaign import store
from pipeline.campaign.worker import Batch, Limit, attempt, ended, overdue, share
from pipeline.config.schema import Config
from pipeline.console import interrupts
from pipeline.console.errors import DataError
from pipeline.console.progress import CampaignProgress

_FLUSH_INTERVAL_S = 2.0
_QUEUED_PER_WORKER = 4
_SHARES = 2
_DEATHS_OF_A_RUN = 2  # once may be somebody else's doing
_DEATHS_IN_A_ROW = 20  # more than it takes to find a run in the largest usual batch
_PATIENCE_S = 60.0
_LOOK_S = 10.0
_LEAST_SHARE = 0.1


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


@dataclass
class _Work:
    """What is still to be done.

    Attributes
    ----------
    waiting : iterator of list of int
        Batches that no worker has had yet.
    sent : dict of Future to list of int
        Batches with workers.
    suspects : deque of list of int
        Batches whose worker ended.
    deaths : Counter
        Workers that a run has ended alone.
    in_a_row : int
        Workers that ended since a batch last came back.
    shared : Future or None
        The experiment; None if its worker ended while it took it.
    """

    waiting: Iterator[list[int]]
    sent: dict[Future, list[int]] = field(default_factory=dict)
    suspects: deque[list[int]] = field(default_factory=deque)
    deaths: Counter[int] = field(default_factory=Counter)
    in_a_row: int = 0
    shared: Future | None = None


def fan_out(
    config: Config,
    experiment: Experiment,
    todo: np.ndarray,
    target: zarr.Group,
    workers: Client,
    progress: CampaignProgress,
) -> None:
    """Keep every worker supplied, write what comes back, release it.

    Parameters
    ----------
    config : Config
    experiment : Experiment
    todo : ndarray of int
        Run numbers, ascending.
    target : zarr.Group
        The store.
    workers : Client
    progress : CampaignProgress

    Raises
    ------
    DataError
        If workers or scheduler are lost for good, or the store is.
    """
    finished: list[tuple[list[int], Batch]] = []
    flushed = time.monotonic()
    overdue.clear()
    work = _Work(batches(todo, config.campaign.batch, lambda: _threads(workers)))
    limit = Limit(config.campaign.batch_time_limit_s, config.cluster.kind != "threads")

    def send(runs: list[int]) -> None:
        if work.shared is None:
            work.shared = workers.submit(share, experiment, pure=False)
        own = _limit_of(runs, limit, config.campaign.batch)
        work.sent[workers.submit(attempt, work.shared, runs, own, pure=False)] = runs

    def write() -> None:
        store.write(target, config, finished)
        finished.clear()

    try:
        _supply(work, workers, send)
        while work.sent:
            for future in _done(workers, [*work.sent]):
                with interrupts.held():
                    runs = work.sent.pop(future)
                    batch = _result(future, runs, work, experiment, limit)
                    future.release()
                    _supply(work, workers, send)
                    if batch is None:
                        continue
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


def _limit_of(runs: list[int], limit: Limit, largest: int) -> Limit:
    """Less time for fewer runs, or it takes hours to find one that hangs."""
    share = max(len(runs) / largest, _LEAST_SHARE)
    return replace(limit, seconds=limit.seconds * share)


def _threads(workers: Client) -> int:
    return max(1, sum(workers.nthreads().values()))


def _supply(work: _Work, workers: Client, send: Callable[[list[int]], None]) -> None:
    """Send what there is room for; suspects alone, when nothing else is left."""
    room = _QUEUED_PER_WORKER * _threads(workers) - len(work.sent)
    for _ in range(room):
        runs = next(work.waiting, None)
        if runs is None:
            break
        send(runs)
    if not work.sent and work.suspects:
        send(work.suspects.popleft())


def _done(workers: Client, sent: list[Future]) -> set[Future]:
    """Batches that came back, of which there is at least one."""
    alone_since = time.monotonic()
    while True:
        if overdue:
            runs = overdue.pop()
            raise DataError(
                f"runs {runs[0]} to {runs[-1]} take longer than campaign.batch_time_limit_s; with "
                "cluster=processes the run is found, and the others are made"
            )
        try:
            return wait(sent, timeout=_LOOK_S, return_when="FIRST_COMPLETED").done
        except TimeoutError:
            if workers.status != "running":
                raise DataError("the connection to the scheduler is lost") from None
            if workers.nthreads():
                alone_since = time.monotonic()
            elif time.monotonic() - alone_since > _PATIENCE_S:
                raise DataError("all workers are lost, and no new ones came") from None
        except CancelledError:
            raise DataError("the connection to the scheduler is lost") from None


def _result(
    future: Future, runs: list[int], work: _Work, experiment: Experiment, limit: Limit
) -> Batch | None:
    """What a batch gave; None of one that is to be tried again."""
    try:
        batch = future.result()
    except KilledWorker as error:
        work.in_a_row += 1
        if work.in_a_row > _DEATHS_IN_A_ROW:
            raise DataError(
                f"{work.in_a_row} worker processes in a row have ended, the last one with runs "
                f"{runs[0]} to {runs[-1]}: is there memory enough, and is "
                f"campaign.batch_time_limit_s = {limit.seconds:g} enough?"
            ) from None
        if error.task != future.key:  # the experiment was lost, and no batch is to blame
            work.shared = None
            work.suspects.append(runs)
            return None
        return _suspected(runs, work, experiment, limit)
    except CancelledError:
        raise DataError("the connection to the scheduler is lost") from None
    work.in_a_row = 0
    return batch


def _suspected(runs: list[int], work: _Work, experiment: Experiment, limit: Limit) -> Batch | None:
    """Split a batch whose worker ended; give up a run that ends every one."""
    if len(runs) > 1:
        half = len(runs) // 2
        work.suspects.extend([runs[:half], runs[half:]])
        return None
    if not work.sent:  # the run was alone
        work.deaths[runs[0]] += 1
    if work.deaths[runs[0]] < _DEATHS_OF_A_RUN:
        work.suspects.append(runs)
        return None
    return ended(
        experiment,
        runs[0],
        f"its worker process ended {_DEATHS_OF_A_RUN} times, out of memory, by a fault in machine "
        f"code or after more than campaign.batch_time_limit_s = {limit.seconds:g}",
    )


def _failures(runs: list[int], batch: Batch, seed: int) -> Iterator[str]:
    """Say of every failed run of a batch why it did, and how it is repeated."""
    for place in np.flatnonzero(batch.outcome.failed):
        number = runs[place]
        why = batch.exceptions.get(number, REASONS[batch.outcome.reason[place]])
        yield f"run {number} failed: {why} (seed {seed}); repeat with only_run={number}"
