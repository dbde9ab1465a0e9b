"""The laboratory experiment as a virtual one: two calibrations of one unit, and a flight on each.

The truth is what the paper's Table 4 found. Its gyro scale factors are relative to a nominal scale
that is not stated, so a coarse scale factor comes first, as a laboratory would apply the data
sheet's; the calibrator sees what is left.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from inscal import experiment, units
from inscal.experiment import Experiment, Outcome
from inscal.free_inertial import Flight, fly
from inscal.kernel import LANES
from inscal.parameters import COUNT, INDEX, members, vector
from inscal.simulation import TruthModel, Workspace, simulate
from pipeline.config.setup import Setup
from pipeline.console.progress import track
from pipeline.paper.config import PaperConfig
from pipeline.paper.values import TABLE_4, LaboratoryCalibration

COMPENSATED, UNCOMPENSATED, PERFECT = "compensated", "uncompensated", "perfectly known"
"""What a flight is navigated with: the second calibration, nothing, or the true parameters."""

_EVERY = 10  # steps from one entry of a flight's course to the next


@dataclass(frozen=True)
class Residual:
    """Calibrations of a unit with nothing but an error left in the scale factors of one sensor.

    Attributes
    ----------
    sensor : str
        ``gyro`` or ``accel``.
    ppm : float
        Scale factor error of all three axes.
    passes : int
    failed, runs : int
        Runs that diverged, of how many.
    nees : float
        Mean of the others, NaN if there are none.
    """

    sensor: str
    ppm: float
    passes: int
    failed: int
    runs: int
    nees: float


@dataclass(frozen=True)
class Study:
    """All that the laboratory report says; parameters in paper units and state order.

    Attributes
    ----------
    truth : ndarray, shape (2, 27)
        What is left to calibrate at the two dates.
    estimate : ndarray, shape (2, runs, 27)
    nees : ndarray, shape (2, runs)
    sigma : ndarray, shape (27,)
        Predicted, of one calibration.
    flights : dict of str to Flight
        By what was compensated, a lane per run.
    residuals : list of Residual
    """

    config: PaperConfig
    truth: np.ndarray
    estimate: np.ndarray
    nees: np.ndarray
    sigma: np.ndarray
    flights: dict[str, Flight]
    residuals: list[Residual]


def residual_truth(
    calibration: LaboratoryCalibration,
    coarse_gyro_ppm: Sequence[float],
    coarse_pulses: Sequence[float],
    unit: np.ndarray,
) -> np.ndarray:
    """What a calibration leaves to find once coarse scale factors are applied.

    With coarse gyro factors 1 + c the matrix I + dKg acts on readings 1 + c times as large, so each
    of its columns is divided by them; an accelerometer of K pulses read with K0 has the factor
    K0/K.

    Parameters
    ----------
    calibration : LaboratoryCalibration
    coarse_gyro_ppm, coarse_pulses : sequence of 3 float
    unit : ndarray, shape (27,)
        Paper units in SI.

    Returns
    -------
    ndarray, shape (27,)
        Parameters, SI.
    """
    scale = {
        "gyro_scale_factor": calibration.gyro_scale_ppm,
        "accel_scale_factor": (0.0, 0.0, 0.0),
    }
    out = vector({**calibration.values, **scale}) * unit
    gyro_columns, gyro_rows = np.triu_indices(3)  # a lower triangle column by column
    gyro = np.eye(3)
    gyro[gyro_rows, gyro_columns] += out[INDEX["gyro_k"]]
    gyro /= 1.0 + 1e-6 * np.array(coarse_gyro_ppm)
    out[INDEX["gyro_k"]] = (gyro - np.eye(3))[gyro_rows, gyro_columns]
    accel = np.eye(3) + out[INDEX["accel_k"]].reshape(3, 3).T
    accel *= np.array(coarse_pulses) / np.array(calibration.accel_pulses)
    out[INDEX["accel_k"]] = (accel - np.eye(3)).T.ravel()
    return out


def with_truth(shared: Experiment, truth: np.ndarray) -> Experiment:
    """Copy an experiment with one true unit for all runs; `truth` in SI, shape (27,)."""
    return replace(shared, truth=replace(shared.truth, parameters=TruthModel("fixed", truth)))


def flights_of(
    shared: Experiment, truth: np.ndarray, calibrated: np.ndarray, runs: Sequence[int]
) -> dict[str, Flight]:
    """Fly the path with the sensors of `truth`, compensated by each run's own calibration.

    Parameters
    ----------
    shared : Experiment
    truth : ndarray, shape (27,)
        SI.
    calibrated : ndarray, shape (runs, 27)
        Estimates, SI.
    runs : sequence of int
        Numbers of the flights' random streams.

    Returns
    -------
    dict of str to Flight
    """
    workspace = Workspace.of(shared.motion)
    pieces: dict[str, list[Flight]] = {COMPENSATED: [], UNCOMPENSATED: [], PERFECT: []}
    for first in range(0, len(runs), LANES):
        lanes = np.minimum(first + np.arange(LANES), len(runs) - 1)  # spare lanes repeat the last
        used = min(LANES, len(runs) - first)
        true = np.repeat(truth[:, None], LANES, axis=1)
        record = simulate(
            true,
            shared.motion,
            shared.truth.noise,
            shared.truth.initial,
            seed=shared.seed,
            runs=[runs[lane] for lane in lanes],
            workspace=workspace,
        )
        known = {
            COMPENSATED: calibrated[lanes].T,
            UNCOMPENSATED: np.zeros((COUNT, LANES)),
            PERFECT: true,
        }
        for name, parameters in known.items():
            flight = fly(record.sensors, parameters, shared.motion, shared.site, every=_EVERY)
            pieces[name].append(
                Flight(flight.time, flight.velocity[..., :used], flight.position[..., :used])
            )
    return {name: _joined(parts) for name, parts in pieces.items()}


def _joined(parts: list[Flight]) -> Flight:
    return Flight(
        parts[0].time,
        np.concatenate([part.velocity for part in parts], axis=2),
        np.concatenate([part.position for part in parts], axis=2),
    )


def residuals_of(config: PaperConfig) -> list[Residual]:
    """Calibrate units whose only errors are scale factors, larger and larger ones."""
    own, out = config.laboratory, []
    cases = product(("gyro", "accel"), own.residual_passes, own.residual_scale_factors_ppm)
    for sensor, passes, ppm in track(list(cases), "coarse scale factors"):
        outcome = _with_residual(config, sensor, ppm, passes)
        good = outcome.nees[~outcome.failed]
        nees = float(good.mean()) if len(good) else float("nan")
        failed, runs = int(outcome.failed.sum()), len(outcome.failed)
        out.append(Residual(sensor, ppm, passes, failed, runs, nees))
    return out


def _with_residual(config: PaperConfig, sensor: str, ppm: float, passes: int) -> Outcome:
    """Calibrate with a prior at least as wide as the residual, for a fair chance."""
    estimator, key = config.estimator, f"{sensor}_scale_factor_ppm"
    wide = replace(estimator.initial_std)
    setattr(wide, key, max(ppm, getattr(wide, key)))
    adapted = replace(config, estimator=replace(estimator, max_passes=passes, initial_std=wide))
    truth = np.zeros(COUNT)
    truth[members(f"{sensor}_scale_factor")] = ppm * units.PPM
    shared = with_truth(Setup(adapted).experiment, truth)
    return experiment.run(shared, range(config.laboratory.runs))


def study_of(config: PaperConfig) -> Study:
    """Calibrate twice, fly, and find how coarse a coarse scale factor may be."""
    own, unit = config.laboratory, Setup(config).unit
    truth = np.array(
        [
            residual_truth(
                calibration,
                own.coarse_gyro_scale_factor_ppm,
                own.coarse_accel_pulses_per_m_per_s,
                unit,
            )
            for calibration in TABLE_4
        ]
    )
    shared, runs = Setup(config).experiment, own.runs
    # every calibration and every flight meets noise of its own
    outcomes = [
        experiment.run(with_truth(shared, truth[date]), range(date * runs, (date + 1) * runs))
        for date in range(len(TABLE_4))
    ]
    flown = range(len(TABLE_4) * runs, (len(TABLE_4) + 1) * runs)
    return Study(
        config=config,
        truth=truth / unit,
        estimate=np.array([outcome.estimate for outcome in outcomes]) / unit,
        nees=np.array([outcome.nees for outcome in outcomes]),
        sigma=shared.estimator.predicted_std / unit,
        flights=flights_of(shared, truth[-1], outcomes[-1].estimate, flown),
        residuals=residuals_of(config),
    )
