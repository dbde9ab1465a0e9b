"""Stage `simulate`: a campaign of calibrated runs into a store, or one of its runs in full.

Usage: ``python -m pipeline.simulate [schedule=...] [noise=...] [truth=...] [campaign.runs=...]``,
``only_run=17`` to repeat run 17 alone and keep its course, ``campaign.precision=0.05`` to stop as
soon as every RMSE is known to five per cent (half of its 95 % interval).

For example::

    python -m pipeline.simulate schedule=position19 noise=quiet
    python -m pipeline.simulate campaign.precision=0.03 campaign.runs=20000 campaign.store=results/x
    python -m pipeline.simulate only_run=17    # this run again, with its course over time

Reads: schedule noise truth estimator cluster cluster.workers cluster.address campaign.runs
campaign.precision campaign.seed campaign.batch campaign.store campaign.replace only_run out site
simulation sensor.
"""

import gc
import json
import math
import shlex
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from itertools import islice
from pathlib import Path

import numpy as np
import xarray as xr
import zarr
from dask.typing import Key
from distributed import Client, as_completed

from inscal.experiment import Experiment, Outcome, run_with_history
from inscal.kernel import LANES
from inscal.parameters import NAMES, UNITS
from pipeline import interrupts, provenance, store
from pipeline.build import build_experiment, build_schedule, si_units, warnings
from pipeline.cluster import check, client
from pipeline.config import Config, DataError, resolved, stage
from pipeline.lock import writing
from pipeline.output import complain
from pipeline.progress import CampaignProgress
from pipeline.worker import attempt, share

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
        share = len(pending) / (_SHARES * threads())
        size = min(largest, LANES * math.ceil(share / LANES))
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
    """
    check(config.cluster)
    experiment = build_experiment(config)
    predicted_std = experiment.estimator.predicted_std / si_units(config)
    with writing(config.campaign.store):
        with interrupts.held():
            target = store.open_store(config, predicted_std)
        with (
            provenance.session(config.campaign, config.cluster, lambda: len(store.pending(target))),
            interrupts.telling(lambda: kept_line(config, target)),
        ):
            _make_pending(config, experiment, target)


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
            if wanted is not None and (precision := store.precision(target, limit)) < wanted:
                progress.say(f"every RMSE is known to {100 * precision:.1f} %: enough")
                break


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
    finished: list[tuple[list[int], Outcome]] = []
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
                runs, outcome = numbers.pop(future.key), future.result()
                future.release()
                supply()
                finished.append((runs, outcome))
                for failed in np.array(runs)[outcome.failed]:
                    progress.say(
                        f"run {failed} failed (seed {config.campaign.seed}); "
                        f"repeat with only_run={failed}"
                    )
                if time.monotonic() - flushed > _FLUSH_INTERVAL_S:
                    write()
                    flushed = time.monotonic()
                progress.advance(len(runs))
    finally:  # interrupted or not, nothing finished is lost
        with interrupts.held():
            write()


def history_dataset(config: Config) -> xr.Dataset:
    """Course of run `only_run`: estimates, errors, predicted sigma and innovations at every update.

    Parameters
    ----------
    config : Config

    Returns
    -------
    xarray.Dataset
        Dimensions calibration_pass, time, parameter and observation; parameters in paper units.
    """
    experiment = build_experiment(config)
    number = config.only_run
    assert number is not None
    outcome, history = run_with_history(experiment, number)
    unit = si_units(config)
    passes = range(experiment.estimator.passes)
    truth, estimate = outcome.truth[0] / unit, history.estimate[..., 0] / unit
    course = ("calibration_pass", "time", "parameter")
    observed = ("calibration_pass", "time", "observation")
    per_parameter = {"units": "see coordinate unit"}
    per_observation = {"units": "see coordinate observation_unit"}
    interval = config.estimator.update_interval_s
    gains = [experiment.estimator.gains(p) for p in passes]
    return xr.Dataset(
        {
            "truth": ("parameter", truth, per_parameter),
            "final_estimate": ("parameter", outcome.estimate[0] / unit, per_parameter),
            "final_error": ("parameter", outcome.estimate[0] / unit - truth, per_parameter),
            "estimate": (course, estimate, per_parameter),
            "error": (course, estimate - truth, per_parameter),
            "predicted_std": (
                course,
                np.array([g.parameter_std for g in gains]) / unit,
                per_parameter,
            ),
            "innovation": (observed, history.innovation[..., 0], per_observation),
            "innovation_std": (
                observed,
                np.sqrt(np.array([g.innovation_covariance for g in gains]).diagonal(0, 2, 3)),
                per_observation,
            ),
            "nees": ((), outcome.nees[0], {"units": "1"}),
        },
        coords={
            "calibration_pass": np.arange(1, len(passes) + 1),
            "time": (
                "time",
                interval * np.arange(1, experiment.motion.updates + 1),
                {"units": "s"},
            ),
            "parameter": np.array(NAMES, dtype=object),
            "unit": ("parameter", np.array(UNITS, dtype=object)),
            "observation": np.array(
                [f"velocity_{d}" for d in ("north", "east", "down")]
                + [f"position_{d}" for d in ("north", "east", "height")],
                dtype=object,
            ),
            "observation_unit": ("observation", np.array(["m/s"] * 3 + ["m"] * 3, dtype=object)),
        },
        attrs={
            "run": number,
            "seed": config.campaign.seed,
            "positions": build_schedule(config).positions,
            "configuration": json.dumps(resolved(config)),
        },
    )


def repeat_run(config: Config) -> None:
    """Repeat one run of a campaign and write its course as netCDF.

    Raises
    ------
    DataError
        If the file cannot be written.
    """
    path = Path(config.out or f"{config.campaign.store}-run{config.only_run}.nc")
    course = history_dataset(config)
    try:
        with interrupts.held():
            path.parent.mkdir(parents=True, exist_ok=True)
            course.to_netcdf(path, engine="scipy")
            interrupts.wrote(path)
    except OSError as error:
        raise DataError(f"out = {path}: cannot be written ({error.strerror})") from None
    print(f"run {config.only_run} of seed {config.campaign.seed}: course in {path}")


@stage
def main(config: Config) -> None:
    """Run the campaign, or the one run asked for."""
    complain(warnings(config))
    if config.only_run is None:
        simulate_campaign(config)
    else:
        repeat_run(config)


if __name__ == "__main__":
    main()
