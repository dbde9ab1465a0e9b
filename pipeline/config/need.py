"""What a configuration needs of a machine, before any of it is taken.

The sizes are those of the arrays that an experiment and its workers hold; the times are of one
machine, and good to a factor of two or three elsewhere.
"""

import os
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from inscal.parameters import AUGMENTATIONS
from inscal.profile import profile_of
from pipeline.config.schema import Config
from pipeline.console.errors import ConfigError

_BASE = 150e6  # libraries of a process
_LANES = 32  # of inscal.kernel, which need not be compiled for this
_PLAIN_STATES = 36
_PER_AUGMENTATION = 3.2  # states, most of them having one an axis
_PER_RUN = 1300.0  # bytes of a store, and what is judged of it
_RUN_S = 2.8e-8  # of a step or update of a run and pass
_UPDATE_S = 4.6e-5  # of the gains at an update
_NOTED_SHARE = 0.5
_NOTED_S = 3600.0
_LONG_S = 1e5


@dataclass(frozen=True)
class Need:
    """Estimates.

    Attributes
    ----------
    steps, updates : float
        Of a run.
    experiment, worker, runs : float
        Memory of the experiment, of what a worker adds, and of the runs of a campaign, bytes.
    preparation_s, run_s : float
        Time of the experiment, and of one run.
    """

    steps: float
    updates: float
    experiment: float
    worker: float
    runs: float
    preparation_s: float
    run_s: float

    def memory(self, config: Config, workers: int) -> float:
        """Bytes of a campaign with so many workers on this machine."""
        if config.cluster.kind == "processes":
            return _BASE + 2.4 * self.experiment + self.runs + workers * self._process()
        return _BASE + 1.4 * self.experiment + self.runs + workers * self.worker

    def _process(self) -> float:
        return _BASE + 2.4 * self.experiment + self.worker


def need_of(config: Config) -> Need:
    """Estimate what a configuration needs.

    Parameters
    ----------
    config : Config
        Checked.

    Returns
    -------
    Need
    """
    about, sampling = config.schedule, config.simulation
    turning = whole = 0.0
    for rotation in about.rotations:
        angle, _, seconds, rate = (*rotation, None, None)[:4]
        whole += seconds or about.position_duration_s
        turning += profile_of(
            abs(angle), rate or about.turn_rate_deg_per_s, about.turn_acceleration_deg_per_s2
        ).duration
    whole += about.last_position_duration_s or about.position_duration_s
    interval = config.estimator.update_interval_s
    updates = whole / interval
    steps = turning / min(sampling.turn_step_s, interval)
    steps += (whole - turning) / min(sampling.dwell_step_s, interval)
    extra = sum(name in AUGMENTATIONS for name in config.estimator.states)
    states = _PLAIN_STATES + _PER_AUGMENTATION * extra
    passes = config.estimator.passes  # of a usual run: few need more
    return Need(
        steps,
        updates,
        8.0 * updates * (0.121 * states**2 + 14.2 * states) * passes / 2 + 150.0 * steps,
        8.0 * 6 * _LANES * (steps + updates),
        _PER_RUN * config.campaign.runs,
        _UPDATE_S * updates * states / _PLAIN_STATES * passes / 2,
        _RUN_S * passes * (steps + updates) * (states / _PLAIN_STATES) ** 0.7,
    )


def memory_of_machine() -> float:
    """Bytes that a process may take here: of the machine, or what its group is allowed."""
    out = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    for file in ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"):
        try:
            out = min(out, float(Path(file).read_text(encoding="ascii")))
        except (OSError, ValueError):
            continue
    return out


def check(config: Config) -> None:
    """Refuse what this machine cannot hold, whatever the number of workers.

    Raises
    ------
    ConfigError
        With what is needed, what there is, and the keys that decide it.
    """
    need, there = need_of(config), memory_of_machine()
    least = need.memory(config, 1)
    if least > there:
        raise ConfigError(
            f"{_largest(config, need)}: needs some {least / 1e9:.3g} GB of memory (steps a run: "
            f"{need.steps:.3g}, updates: {need.updates:.3g}, runs: {config.campaign.runs:.3g}); "
            f"this machine has {there / 1e9:.3g} GB"
        )


def _largest(config: Config, need: Need) -> str:
    """Key that is to blame."""
    if need.runs > need.experiment + need.worker:
        return f"campaign.runs = {config.campaign.runs}"
    longest = max(
        ("position_duration_s", "last_position_duration_s"), key=partial(_seconds, config)
    )
    if _seconds(config, longest) > _LONG_S:
        return f"schedule.{longest} = {_seconds(config, longest):g}"
    if need.steps < 2.0 * need.updates:
        return f"estimator.update_interval_s = {config.estimator.update_interval_s:g}"
    sampling = config.simulation
    key = "turn" if sampling.turn_step_s < sampling.dwell_step_s else "dwell"
    return f"simulation.{key}_step_s = {getattr(sampling, f'{key}_step_s'):g}"


def _seconds(config: Config, key: str) -> float:
    return getattr(config.schedule, key) or 0.0


def fit(config: Config) -> list[str]:
    """Take as many workers as this machine has memory for, and say what a campaign will need.

    Parameters
    ----------
    config : Config
        Its `cluster.workers` is made smaller where it has to be; no result depends on it.

    Returns
    -------
    list of str
        Notes; of a campaign of usual size none.
    """
    workers = config.cluster.workers
    if config.cluster.kind not in ("threads", "processes") or workers is None:
        return []
    need, there, notes = need_of(config), memory_of_machine(), []
    fitting = workers
    while fitting > 1 and need.memory(config, fitting) > there:
        fitting -= 1
    if fitting < workers:
        config.cluster.workers = fitting
        notes.append(f"note: cluster.workers = {workers}: there is memory for {fitting}")
    bytes_needed = need.memory(config, fitting)
    seconds = need.preparation_s + need.run_s * config.campaign.runs / min(
        fitting, os.cpu_count() or 1
    )
    if bytes_needed > _NOTED_SHARE * there or seconds > _NOTED_S:
        notes.append(
            f"note: this needs some {bytes_needed / 1e9:.2g} GB of memory and "
            f"{seconds / 3600:.2g} hours"
        )
    return notes
