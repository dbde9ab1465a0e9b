"""Numbers of the consistency study: estimates against what is claimed and possible, innovations.

Morris, White & Crowther (2019), Statistics in Medicine 38:2074-2102, say what to report of
estimates, and that each number needs its Monte Carlo standard error.
"""

from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from inscal import chance, statistics
from inscal.experiment import Experiment
from inscal.innovations import (
    InnovationStatistics,
    share_beyond_band,
    units_told,
    white_band,
)
from inscal.parameters import COUNT
from inscal.record import OBSERVED
from inscal.statistics import Bounded, Estimate
from pipeline.console.errors import DataError
from pipeline.proof import looks
from pipeline.proof.looks import OUTSIDE_BAND, Innovations

LAGS = range(1, 21)
"""Lags of the autocorrelations, in updates."""

CONFIDENCE = 0.99
"""Of the intervals of innovations that are shown and no goal."""

COVERING = statistics.normal_quantile(0.95)
"""Half the width of a 95 % interval, in sigmas."""

OBSERVATIONS = [f"velocity {axis}" for axis in "NED"] + [f"position {axis}" for axis in "NEh"]
"""Components of an innovation: North, East, Down, height."""

_STRETCHES = 5
_PAPER_UNIT = "see coordinate unit"


class Bounds(NamedTuple):
    """Cramér-Rao bounds of the parameters, in paper units, and what they say of the filter.

    Attributes
    ----------
    bayesian : ndarray, shape (27,)
        Standard deviations for parameters spread like the campaign's truth.
    classical : ndarray, shape (27,)
        Standard deviations without prior knowledge.
    filter_difference : float
        Largest difference between the filter's covariance and the bound for the filter's own
        prior, in units of the sigmas of its row and column.
    """

    bayesian: np.ndarray
    classical: np.ndarray
    filter_difference: float


def estimates(done: xr.Dataset, bounds: Bounds) -> xr.Dataset:
    """Performance of the estimates per parameter, and of all at once.

    Parameters
    ----------
    done : xarray.Dataset
        Runs done, all parameters modelled.
    bounds : Bounds

    Returns
    -------
    xarray.Dataset
        As of `inscal.summary.summarize`; _mcse is a Monte Carlo standard error, _lower and _upper
        are exact 95 % intervals, _lower_all and _upper_all those that goals are judged by, of
        `pipeline.proof.looks.level`.
    """
    error = done["error"].transpose("run", "parameter").to_numpy()
    sigma = done["predicted_std"].to_numpy()
    half_width = COVERING * sigma
    within = (np.abs(error) <= half_width).mean(axis=0)
    bias = statistics.bias(error)
    columns: dict[str, Any] = {
        **_with_mcse("bias", bias, _PAPER_UNIT),
        "bias_over_mcse": _variable(bias.value / bias.mcse, "1"),
        **_with_mcse("std", statistics.standard_deviation(error), _PAPER_UNIT),
        "predicted_std": _variable(sigma, _PAPER_UNIT),
        **_with_mcse("model_error_percent", statistics.model_error_percent(error, sigma), "%"),
        **_with_mcse(
            "coverage_95_percent",
            Estimate(within, np.sqrt(within * (1.0 - within) / len(error))),
            "1",
        ),
        **_with_mcse(
            "bias_eliminated_coverage_95_percent",
            statistics.bias_eliminated_coverage(error, half_width),
            "1",
        ),
        "rmse": _variable(statistics.rmse(error).value, _PAPER_UNIT),
        "bayesian_bound": _variable(bounds.bayesian, _PAPER_UNIT),
        "classical_bound": _variable(bounds.classical, _PAPER_UNIT),
    }
    for suffix in ("", "_all"):
        confidence = 1.0 - looks.level("rmse_over_bound") if suffix else 0.95
        ratio = Bounded(*(s / bounds.bayesian for s in chance.rmse_of_normal(error, confidence)))
        columns |= _with_interval("rmse_over_bound", ratio, suffix)
        for count in (1, 2, 3):
            name = f"coverage_{count}_sigma"
            confidence = 1.0 - looks.level(name) if suffix else 0.95
            inside = (np.abs(error) <= count * sigma).sum(axis=0)
            share = chance.clopper_pearson(inside, len(error), confidence)
            columns |= _with_interval(name, share, suffix)
    nees = done["nees"].to_numpy()
    lower, upper = statistics.nees_interval(len(nees), COUNT, 1.0 - looks.level("nees"))
    scalars = {
        "runs_done": len(nees),
        "runs_failed": done.attrs["failed"],
        "nees_mean": nees.mean(),
        "nees_lower": lower,
        "nees_upper": upper,
        "nees_distribution_p": chance.distribution_p(nees, COUNT),
        "filter_difference": bounds.filter_difference,
    }
    columns |= {name: _variable(value, "1") for name, value in scalars.items()}
    return xr.Dataset(columns, coords={name: done[name] for name in ("parameter", "unit")})


def looks_at(
    done: xr.Dataset, bounds: Bounds, correlation: np.ndarray, found: Innovations
) -> dict[str, dict[str, Any]]:
    """Look at all that chance can make miss its goal.

    Parameters
    ----------
    done : xarray.Dataset
        Runs done, all parameters modelled.
    bounds : Bounds
    correlation : ndarray, shape (27, 27)
        That the filter claims of its errors.
    found : Innovations
        Of the last pass.

    Returns
    -------
    dict
        By goal, as of `pipeline.proof.looks.smallest`.
    """
    sigma = done["predicted_std"].to_numpy()
    error = done["error"].transpose("run", "parameter").to_numpy() / sigma
    nees = done["nees"].to_numpy()
    at_estimates = looks.at_estimates(error, nees, bounds.bayesian / sigma, correlation)
    return looks.smallest(at_estimates | looks.at_innovations(found))


def stretches_of(positions: int, updates: int) -> list[range]:
    """Positions, counted from 0, of the whole record, of its beginning and of its stretches.

    Raises
    ------
    DataError
        If a stretch would be too short for the lags.
    """
    parts = np.array_split(np.arange(positions), min(_STRETCHES, positions))
    if updates // positions <= max(LAGS):
        raise DataError(f"schedule: the study needs more than {max(LAGS)} updates per position")
    several = [range(int(part[0]), int(part[-1]) + 1) for part in parts]
    return list(dict.fromkeys([range(positions), range(1), *several]))


def innovations(
    repeated: InnovationStatistics, experiment: Experiment, positions: int
) -> dict[str, Any]:
    """Judge the innovations of every pass.

    Parameters
    ----------
    repeated : InnovationStatistics
        From `repeat_runs`.
    experiment : Experiment
    positions : int
        Of the schedule.

    Returns
    -------
    dict
        Of the sample: runs, updates, NEES of the estimates and of those after the first pass
        alone; and ``passes``, each with NIS by position, autocorrelations averaged over runs,
        ``stretches`` of the record, the whole of it first, and ``looks`` at the whole.
    """
    passes, updates, runs = repeated.nis.shape
    covariance = experiment.estimator.parameter_covariance
    first, final = (
        _mean_nees(statistics.nees(estimate - repeated.truth, covariance))
        for estimate in (repeated.first_estimate, repeated.estimate)
    )
    return {
        "runs": runs,
        "updates": updates,
        "observation_noise": _observation_noise(experiment),
        "first_pass_nees": first,
        "nees": final,
        "passes": [
            _pass(
                repeated.nis[number],
                repeated.autocorrelation[number],
                positions,
                units_told(experiment.estimator, number),
            )
            for number in range(passes)
        ],
    }


def last_pass(about: dict[str, Any]) -> Innovations:
    """What goals look at, of the dict that `innovations` makes."""
    return Innovations(**about["passes"][-1]["looks"])


def _observation_noise(experiment: Experiment) -> float:
    """Share of observation noise in the predicted variance of an innovation, median."""
    about = experiment.truth.noise
    noise = np.repeat([about.velocity, about.position], OBSERVED // 2)
    variance = experiment.estimator.first.innovation_covariance.diagonal(axis1=1, axis2=2)
    return float(np.median(noise**2 / variance))


def _pass(nis: np.ndarray, correlation: np.ndarray, positions: int, told: float) -> dict[str, Any]:
    updates, runs = nis.shape
    parts = [updates_of(range(p, p + 1), positions, updates) for p in range(positions)]
    share = share_beyond_band(correlation[0], updates, LAGS, band=1.0 - OUTSIDE_BAND)
    whole = Innovations(
        nis_total=float(nis.sum()),
        nis_dof=runs * (OBSERVED * updates - told),
        beyond=round(float(share.value) * correlation[0].size),
        correlations=correlation[0].size,
    )
    return {
        "units_told": told,
        "looks": whole._asdict(),
        "nis_by_position": [float(nis[part].mean()) for part in parts],
        "pooled": _pooled(correlation[0].mean(axis=-1), nis.size),
        "stretches": [
            _stretch(s, nis[updates_of(s, positions, updates)], correlation[place], told, place)
            for place, s in enumerate(stretches_of(positions, updates))
        ],
    }


def _stretch(
    positions: range, nis: np.ndarray, correlation: np.ndarray, told: float, place: int
) -> dict[str, Any]:
    """Judge a stretch of the record, the whole of it first: by goals' levels, others by one."""
    by_nis, by_share = (
        CONFIDENCE if place else 1.0 - looks.level(goal) for goal in ("nis", "white")
    )
    share = share_beyond_band(
        correlation, len(nis), LAGS, band=1.0 - OUTSIDE_BAND, confidence=by_share
    )
    return {
        "first_position": positions.start + 1,
        "last_position": positions.stop,
        "nis": _mean_nis(nis, told, by_nis, whole=place == 0),
        "share_beyond_band": {k: float(v) for k, v in share._asdict().items()},
    }


def _mean_nis(nis: np.ndarray, told: float, confidence: float, *, whole: bool) -> dict[str, float]:
    """Mean NIS and the interval about what is expected of it.

    Of a part of the record only limits of that are known: none of the units told, or all of them,
    are missing there.
    """
    updates, runs = nis.shape
    least = max(OBSERVED * updates - told, 1.0)
    most = least if whole else float(OBSERVED * updates)
    lower, _ = chance.chi_square_limits(runs * least, confidence)
    _, upper = chance.chi_square_limits(runs * most, confidence)
    return {
        "mean": float(nis.mean()),
        "expected_least": least / updates,
        "expected_most": most / updates,
        "lower": float(lower) * least / updates,
        "upper": float(upper) * most / updates,
    }


def _mean_nees(values: np.ndarray) -> dict[str, float]:
    lower, upper = statistics.nees_interval(values.size, COUNT, CONFIDENCE)
    return {"mean": float(values.mean()), "lower": lower, "upper": upper}


def _pooled(mean: np.ndarray, values: int) -> dict[str, Any]:
    """Autocorrelations (lags, 6) averaged over runs, `values` being what each is an average of."""
    lag, component = np.unravel_index(np.abs(mean).argmax(), mean.shape)
    band = white_band(values, 1.0 - OUTSIDE_BAND)
    return {
        "band": band,
        "count": mean.size,
        "beyond": int((np.abs(mean) > band).sum()),
        "largest": float(mean[lag, component]),
        "largest_lag": LAGS[lag],
        "largest_observation": OBSERVATIONS[component],
    }


def updates_of(positions: range, count: int, updates: int) -> slice:
    """Updates of some of `count` positions that share `updates` of them equally."""
    return slice(positions.start * updates // count, positions.stop * updates // count)


def _variable(values: np.ndarray | float, units: str) -> xr.Variable:
    array = np.asarray(values)
    return xr.Variable(("parameter",) if array.ndim else (), array, {"units": units})


def _with_mcse(name: str, estimate: Estimate, units: str) -> dict[str, xr.Variable]:
    return {
        name: _variable(estimate.value, units),
        f"{name}_mcse": _variable(estimate.mcse, units),
    }


def _with_interval(name: str, bounded: Bounded, suffix: str) -> dict[str, xr.Variable]:
    return {
        name: _variable(bounded.value, "1"),
        f"{name}_lower{suffix}": _variable(bounded.lower, "1"),
        f"{name}_upper{suffix}": _variable(bounded.upper, "1"),
    }
