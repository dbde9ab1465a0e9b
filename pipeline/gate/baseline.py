"""The gate's campaigns, and the baselines they are held against.

A baseline of a case is three text files: ``baseline.json`` (reason, configuration with its seed,
digests of the other two), ``errors.csv`` (a row per run: NEES, sketch of its data, 27 errors) and
``covariance.csv`` (what the filter claims), all in SI, in as many digits as bring back every bit.
"""

import csv
import hashlib
import io
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from inscal import units
from inscal.campaign_checks import Sample
from inscal.experiment import Experiment, run
from inscal.kernel import LANES
from inscal.parameters import COUNT, NAMES
from inscal.simulation import Workspace
from pipeline.config.load import resolved, run_settings
from pipeline.config.schema import Config
from pipeline.console.errors import DataError
from pipeline.console.output import write_json, write_text
from pipeline.gate.cases import REFERENCE, RUNS, Draws

# What sketches are in units of: noise of the size of the reference case. Fixed numbers, so that a
# change of the noise is a change of the sketch.
_ANGLE_NOISE = 0.0005 * units.DEG_PER_SQRT_HOUR
_VELOCITY_NOISE = 5.0 * units.MICRO_G
_OBSERVATION_NOISE = np.repeat([0.001, 0.1], 3)


def configuration_of(config: Config) -> dict[str, Any]:
    """What of a configuration makes the reference case, seed included."""
    return run_settings(resolved(config))


def folder_of(baselines: Path, case: str) -> Path:
    """Folder of a case's baseline; that of the reference case holds the others'."""
    return baselines if case == REFERENCE else baselines / "cases" / case


def sample_of(experiment: Experiment, draws: Sequence[Draws] = ()) -> Sample:
    """Make a campaign of the gate.

    Parameters
    ----------
    experiment : Experiment
    draws : sequence of Draws
        Its runs; if none, 0 to `RUNS` - 1 of the experiment's seed.

    Returns
    -------
    Sample
    """
    workspace = Workspace.of(experiment.motion)
    sign = _signs(experiment.motion.steps), _signs(experiment.motion.updates)
    errors, consistency, sketches = [], [], []
    for seed, numbers in _tiles(draws or [Draws(experiment.seed, 0, RUNS)]):
        outcome = run(replace(experiment, seed=seed), numbers, workspace)
        errors.append(outcome.estimate - outcome.truth)
        consistency.append(outcome.nees)
        # the workspace still holds what the estimator has just seen
        sketch = _sketch(workspace, experiment.motion.duration, *sign)
        sketches.append(sketch[: len(numbers)])
    return Sample(
        np.concatenate(errors),
        experiment.estimator.parameter_covariance,
        np.concatenate(consistency),
        np.concatenate(sketches),
    )


def _tiles(draws: Sequence[Draws]) -> Iterator[tuple[int, list[int]]]:
    """Runs that are made together: a seed and numbers, no more than there are lanes."""
    for seed in dict.fromkeys(one.seed for one in draws):
        numbers = [number for one in draws if one.seed == seed for number in one.numbers]
        for first in range(0, len(numbers), LANES):
            yield seed, numbers[first : first + LANES]


def _signs(rows: int) -> np.ndarray:
    rng = np.random.Generator(np.random.SFC64(0))
    return 2.0 * rng.integers(0, 2, (rows, 6)) - 1.0


def _sketch(workspace: Workspace, duration, sensor_sign, observation_sign) -> np.ndarray:
    """Random projection of the record of each lane, in units of noise.

    Any change of the record shows in it in full size, but for one chance in thousands per run
    (Johnson & Lindenstrauss); differences of rounding stay far below the noise, where a digest of
    the bits would take another processor for other data. The record depends on the truth more than
    estimates can tell, so the truth needs no sketch of its own.
    """
    noise = np.repeat([_ANGLE_NOISE, _VELOCITY_NOISE], 3) * np.sqrt(duration)[:, None]
    sensors = workspace.sensors * (sensor_sign / noise)[..., None]
    observations = workspace.observations * (observation_sign / _OBSERVATION_NOISE)[..., None]
    return sensors.sum(axis=(0, 1)) + observations.sum(axis=(0, 1))


def write_baseline(
    folder: Path, sample: Sample, configuration: Mapping[str, Any], reason: str
) -> None:
    """Write the baseline of a case.

    Parameters
    ----------
    folder : Path
    sample : Sample
    configuration : mapping
        That of the case.
    reason : str

    Raises
    ------
    DataError
        If a file cannot be written.
    """
    errors = np.column_stack([sample.nees, sample.sketch, sample.error])
    texts = {
        "errors": _csv_text(["nees", "sketch", *NAMES], errors),
        "covariance": _csv_text(NAMES, sample.covariance),
    }
    about = {
        "reason": reason,
        "sha256": {name: _digest(text) for name, text in texts.items()},
        "configuration": configuration,
    }
    for name, text in texts.items():
        write_text(folder / f"{name}.csv", text)
    write_json(folder / "baseline.json", about)


def read_baseline(folder: Path, runs: int = RUNS) -> tuple[Sample, dict[str, Any]]:
    """Read the baseline of a case.

    Parameters
    ----------
    folder : Path
    runs : int
        That it has to have.

    Returns
    -------
    sample : Sample
    about : dict
        ``reason`` and ``configuration``.

    Raises
    ------
    DataError
        If a file is missing or not as it was written.
    """
    try:
        about = json.loads((folder / "baseline.json").read_text(encoding="utf-8"))
        texts = {
            name: (folder / f"{name}.csv").read_text(encoding="utf-8")
            for name in ("errors", "covariance")
        }
        if {name: _digest(text) for name, text in texts.items()} != about["sha256"]:
            raise ValueError("a table is not the one that was written")
        if not (isinstance(about["configuration"], dict) and isinstance(about["reason"], str)):
            raise ValueError("baseline.json is incomplete")
        errors = _numbers(texts["errors"], (runs, 2 + COUNT))
        covariance = _numbers(texts["covariance"], (COUNT, COUNT))
    except FileNotFoundError as error:
        raise DataError(
            f"{error.filename}: no baseline; make one with \"accept='reason'\""
        ) from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        line = " ".join(str(error).split())
        raise DataError(f"{folder}: baseline cannot be read ({line})") from None
    return Sample(errors[:, 2:].copy(), covariance, errors[:, 0], errors[:, 1]), about


def _csv_text(header: Sequence[str], rows: Iterable[np.ndarray]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(row.tolist() for row in rows)
    return text.getvalue()


def _numbers(text: str, shape: tuple[int, int]) -> np.ndarray:
    rows = list(csv.reader(io.StringIO(text)))[1:]
    numbers = np.array([[float(entry) for entry in row] for row in rows])
    if numbers.shape != shape:
        raise ValueError(f"a table has shape {numbers.shape}, not {shape}")
    return numbers


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
