"""What a run costs, in its parts and beside a yardstick of the machine."""

import statistics
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from distributed import wait

from inscal.calibrator import calibrate
from inscal.experiment import Experiment, run
from inscal.kernel import LANES, compiled
from inscal.simulation import Workspace, draw_truth, generator, simulate
from pipeline.campaign.cluster import client
from pipeline.campaign.fan_out import batches
from pipeline.campaign.worker import Limit, attempt
from pipeline.config.schema import Config
from pipeline.console.progress import track

_YARDSTICK = 342_000
_ROUNDS = 9
_TILES = 4
_CAMPAIGN = 2000
_WARM = 8 * LANES
_SESSIONS = 5


@compiled
def _draw_yardstick(rng, count):
    total = 0.0
    for _ in range(count):
        total += rng.standard_normal()
    return total


def seconds_of(call: Callable[[], object]) -> float:
    """Wall time of a call, s."""
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def cost(experiment: Experiment) -> dict[str, float]:
    """R, F and their ratio, and the shares of R, as medians over interleaved rounds.

    Parameters
    ----------
    experiment : Experiment

    Returns
    -------
    dict of str to float
        Times in ms.
    """
    rng = generator(0, 0, "sensors")
    workspace = Workspace.of(experiment.motion)
    runs = range(_TILES * LANES)
    truth = np.array([draw_truth(experiment.truth.parameters, 0, r) for r in range(LANES)]).T

    def simulated():
        return simulate(
            truth,
            experiment.motion,
            experiment.truth.noise,
            experiment.truth.initial,
            seed=0,
            runs=range(LANES),
            workspace=workspace,
        )

    record = simulated()
    calls: dict[str, tuple[Callable[[], object], int]] = {
        "F_ms": (lambda: _draw_yardstick(rng, _YARDSTICK), 1),
        "R_ms": (lambda: run(experiment, runs, workspace), len(runs)),
        "simulation_ms": (simulated, LANES),
        "passes_ms": (
            lambda: calibrate(record, experiment.motion, experiment.site, experiment.estimator),
            LANES,
        ),
    }
    for call, _ in calls.values():
        call()
    times: dict[str, list[float]] = {name: [] for name in calls}
    for _ in track(range(_ROUNDS), "one run"):
        for name, (call, count) in calls.items():
            times[name].append(1e3 * seconds_of(call) / count)
    ratio = [r / f for r, f in zip(times["R_ms"], times["F_ms"], strict=True)]
    return {name: statistics.median(t) for name, t in times.items()} | {
        "R_over_F": statistics.median(ratio),
        "normals_per_run": 6.0 * (experiment.motion.steps + experiment.motion.updates),
    }


def throughput(config: Config, experiment: Experiment) -> dict[str, float]:
    """Runs per second of one and of two workers, and the efficiency of the second.

    The workers are threads of dask that a campaign would have, and are given its batches.

    Parameters
    ----------
    config : Config
    experiment : Experiment

    Returns
    -------
    dict of str to float
    """

    def rate(count: int) -> float:
        # one cluster at a time: another would take its share of the cores even when idle
        with client(replace(config.cluster, kind="threads", workers=count)) as workers:

            def seconds(runs: int) -> float:
                todo = list(batches(np.arange(runs), config.campaign.batch, lambda: count))
                limit = Limit(config.campaign.batch_time_limit_s, own_process=False)
                return seconds_of(
                    lambda: wait(
                        workers.map(lambda b: attempt(experiment, b, limit), todo, pure=False)
                    )
                )

            seconds(_WARM)  # every thread takes its memory
            return _CAMPAIGN / seconds(_CAMPAIGN)

    sessions = track(range(_SESSIONS), "campaigns of one and two workers")
    rates = np.array([[rate(1), rate(2)] for _ in sessions])
    return {
        "runs_per_s_one_worker": float(np.median(rates[:, 0])),
        "runs_per_s_two_workers": float(np.median(rates[:, 1])),
        "efficiency_of_two_workers": float(np.median(rates[:, 1] / rates[:, 0])) / 2,
    }
