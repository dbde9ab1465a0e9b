"""Making the runs of a campaign: batches to workers, what comes back to the store."""

import gc
import math
import shlex
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import zarr
from distributed import Client

from inscal.experiment import Experiment
from pipeline.campaign import provenance, store
from pipeline.campaign.cluster import check, client
from pipeline.campaign.fan_out import fan_out
from pipeline.campaign.lock import writing
from pipeline.config import need
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.console import interrupts
from pipeline.console.output import complain
from pipeline.console.progress import CampaignProgress

_FIRST_LOOK = 200
_LOOK_GROWTH = 1.2


_before = False  # whether this process has made a campaign


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
    complain(need.fit(config))
    setup = Setup(config)
    experiment = setup.experiment
    complain(setup.linearisation)
    predicted_std = experiment.estimator.predicted_std / setup.unit
    augmented_std = experiment.estimator.augmented_std / setup.augmented_unit
    with (
        writing(config.campaign.store),
        interrupts.telling(lambda: kept_line(config)),
        ExitStack() as stack,
    ):
        # workers first: a campaign that cannot have any leaves everything as it was
        found = store.look(config)
        workers = None if found.whole else stack.enter_context(client(config.cluster))
        with interrupts.held():
            target = store.open_store(config, predicted_std, augmented_std, found)
        with (
            provenance.session(config.campaign, config.cluster, lambda: len(store.pending(target))),
            # said here already, for it takes a moment to shut the workers down
            interrupts.telling(lambda: kept_line(config)),
        ):
            _make_pending(config, experiment, target, workers)
        store.refuse_failures(config, *store.counts(target))


def kept_line(config: Config) -> str:
    """What an interrupted campaign keeps, and the command that goes on with it."""
    runs = config.campaign.runs
    return (
        f"interrupted: {store.made(config)} of {runs} runs are kept in "
        f"{config.campaign.store}; to go on: {shlex.join(sys.orig_argv)}"
    )


def _make_pending(
    config: Config, experiment: Experiment, target: zarr.Group, workers: Client | None
) -> None:
    pending = store.pending(target)
    runs, wanted = config.campaign.runs, config.campaign.precision
    name = Path(config.campaign.store).name
    with CampaignProgress(runs, runs - len(pending), name) as progress, _left_alone():
        if workers is None:
            return
        for limit in [runs] if wanted is None else checkpoints(runs):
            todo = pending[pending < limit]
            pending = pending[pending >= limit]
            fan_out(config, experiment, todo, target, workers, progress)
            if wanted is None:
                continue
            precision, least = store.precision(target, limit)
            if precision < wanted:
                progress.say(
                    f"every RMSE is known to {100 * precision:.1f} %, that of {least} worst: enough"
                )
                break


@contextmanager
def _left_alone() -> Iterator[None]:
    """Keep full collections, which stop every thread, from looking at all that was imported."""
    global _before
    if _before:  # what an earlier campaign of this process leaves in circles: all of its experiment
        gc.collect()
    _before = True
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def checkpoints(runs: int) -> list[int]:
    """Numbers of runs after which a campaign looks whether it is precise enough.

    They depend on nothing but the largest number: when a campaign stops is no matter of timing.
    """
    out = [min(_FIRST_LOOK, runs)]
    while out[-1] < runs:
        out.append(min(runs, math.ceil(_LOOK_GROWTH * out[-1])))
    return out
