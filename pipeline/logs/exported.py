"""Simulated runs as logs."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import yaml

from inscal.experiment import records
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.console.errors import ConfigError
from pipeline.console.output import write_text, written
from pipeline.logs.header import ACCEL, GYRO, OBSERVED, TIME

_ENDINGS = (".parquet", ".csv")


def chosen(config: Config) -> list[int]:
    """Numbers of the runs that a configuration exports.

    Raises
    ------
    ConfigError
        If it names none, or both one and many.
    """
    if (config.only_run is None) == (config.runs is None):
        raise ConfigError(
            f"only_run = {config.only_run}, runs = {config.runs}: one of them must say what to "
            "export"
        )
    if config.only_run is not None:
        return [config.only_run]
    first, end = map(int, str(config.runs).split(":"))
    if end > config.campaign.runs:
        raise ConfigError(
            f"runs = {config.runs}: must end at campaign.runs, {config.campaign.runs}, at most"
        )
    return list(range(first, end))


def frames(config: Config) -> Iterator[tuple[int, pd.DataFrame]]:
    """Logs of the chosen runs, in order.

    Raises
    ------
    ConfigError
        If turns or updates do not begin with a sample.
    """
    numbers, step = chosen(config), 1.0 / config.rate_hz
    simulation = replace(config.simulation, dwell_step_s=step, turn_step_s=step)
    experiment = Setup(replace(config, simulation=simulation)).experiment
    duration = experiment.motion.duration
    if np.abs(duration / step - 1.0).max() > 1e-6:
        raise ConfigError(
            f"rate_hz = {config.rate_hz:g}: turns of this schedule begin and end between samples"
        )
    time = step * np.arange(1, len(duration) + 1)
    for part, _, record in records(experiment, numbers):
        for lane, number in enumerate(numbers[part]):
            seen = np.full((len(time), len(OBSERVED)), np.nan)
            seen[experiment.motion.update_step[1:] - 1] = record.observations[:, :, lane]
            values = np.column_stack([time, record.sensors[:, :, lane], seen])
            yield number, pd.DataFrame(values, columns=[TIME, *GYRO, *ACCEL, *OBSERVED])


def write(config: Config) -> list[Path]:
    """Write the logs, each with its header; returns the headers.

    Raises
    ------
    ConfigError
        If `log` is no place for them.
    """
    path = Path(config.log or "")
    if config.log is None or path.suffix not in _ENDINGS:
        raise ConfigError(f"log = {config.log}: must be a file that ends in .parquet or .csv")
    headers = []
    for number, frame in frames(config):
        own = path if config.only_run is not None else path.with_stem(f"{path.stem}-{number:06d}")
        with written(own) as file:
            if own.suffix == ".parquet":
                frame.to_parquet(file, index=False)
            else:
                frame.to_csv(file, index=False, float_format="%.17g")
        write_text(own.with_suffix(".yaml"), _header(config, own))
        headers.append(own.with_suffix(".yaml"))
    return headers


def _header(config: Config, data: Path) -> str:
    about = {
        "data": data.name,
        "format": "table",
        "latitude_deg": config.site.latitude_deg,
        "height_m": config.site.height_m,
        "gyro_unit": "rad",
        "accel_unit": "m/s",
        "observed_columns": list(OBSERVED),
        "rate_hz": config.rate_hz,
        "schedule": config.schedule.name,
    }
    return yaml.safe_dump(about, sort_keys=False)
