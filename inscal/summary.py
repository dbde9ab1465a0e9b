"""Statistics of Monte Carlo campaigns, on labelled arrays.

A campaign is an `xarray.Dataset`, all in paper units, with

- data variables truth, estimate and error (run, parameter), predicted_std (parameter; zero where
  the filter does not model the parameter), nees (run; over the modelled parameters) and status
  (run; 0 not run, 1 done, 2 failed);
- coordinates run (int), parameter (str) and unit (parameter; str).

What comes back is a dataset too: variables on parameter alone, and scalars, each with a
`long_name` and its `units`. Formulas and sources are in `inscal.statistics` and
`inscal.comparison_statistics`.
"""

from typing import TypeVar

import numpy as np
import xarray as xr

from inscal import comparison_statistics, statistics
from inscal.statistics import Bounded, Estimate

DONE = 1
"""Status of a run that has results."""

FAILED = 2
"""Status of a run that ended without results."""

CONFIDENCE = 0.95
"""Confidence of every interval of `summarize`."""

_Statistic = TypeVar("_Statistic", Bounded, Estimate)

_PARAMETER_UNIT = "see coordinate unit"

_TRUTH_TOLERANCE = 1e-9
# Relative. Truths that agree by construction may differ by a conversion of units.


def summarize(campaign: xr.Dataset, bound: xr.DataArray) -> xr.Dataset:
    """Error statistics of a campaign, per parameter and as a whole.

    Parameters
    ----------
    campaign : xarray.Dataset
        See the module's description.
    bound : xarray.DataArray
        Accuracy bound on dimension parameter, in paper units; matched by its coordinate, if it
        has one, otherwise in the order of the campaign.

    Returns
    -------
    xarray.Dataset
        On parameter, names ending in _lower and _upper being 95 % intervals and _mcse Monte Carlo
        standard errors:

        - bias, bias_mcse, std, std_mcse, rmse (_lower, _upper), abs_error_p95, abs_error_p997;
        - predicted_std, rmse_over_predicted, model_error_percent, model_error_percent_mcse;
        - coverage_1_sigma, coverage_2_sigma, coverage_3_sigma (_lower, _upper), with the share
          expected of normal errors as attribute `nominal`; bias_eliminated_coverage of 2 sigma,
          bias_eliminated_coverage_mcse;
        - bound, share_within_bound (_lower, _upper), of the runs done or failed.

        Scalars: runs_done, runs_failed; joint_share (_lower, _upper), of the runs done or failed,
        with every parameter within its bound, a failed run being within none; nees_mean, and
        nees_lower and nees_upper between which it lies if the filter is consistent, all NaN where
        it models nothing; precision, the worst relative half-width of the RMSE intervals, and
        least_precise, the parameter it is of.

        With one run done whatever needs a scatter is NaN; so is, of a parameter the filter does
        not model, whatever compares with its predicted standard deviation.

    Raises
    ------
    ValueError
        If no run is done, a run marked done holds a value that is not finite, a predicted
        standard deviation is negative or not finite, or a parameter has no bound.
    """
    done = _done(campaign)
    if done.sizes["run"] == 0:
        raise ValueError("no run of the campaign is done")
    error = done["error"].to_numpy()
    predicted = _predicted_std(done)
    limit = _bound_in_order(bound, done)

    columns = _error_columns(error, done["parameter"].to_numpy())
    columns |= _prediction_columns(error, predicted)
    failed = int((campaign["status"] == FAILED).sum())
    columns |= _bound_columns(error, limit, failed)
    columns |= _nees_scalars(done["nees"].to_numpy(), int((predicted > 0.0).sum()))
    columns["runs_done"] = _variable(len(error), "runs done", "1")
    columns["runs_failed"] = _variable(failed, "runs failed", "1")
    return xr.Dataset(columns, coords=_labels(done), attrs={"confidence": CONFIDENCE})


def augmented(campaign: xr.Dataset) -> xr.Dataset | None:
    """Error statistics of the augmented states of a campaign that do not wander.

    Parameters
    ----------
    campaign : xarray.Dataset
        See the module's description.

    Returns
    -------
    xarray.Dataset or None
        Of `summarize`, on parameter, without bounds; None where there are no such states.

    Raises
    ------
    ValueError
        As of `summarize`.
    """
    if "augmented_error" not in campaign:
        return None
    per_state = {f"augmented_{name}": name for name in ("truth", "estimate", "error")}
    per_state |= {"augmented_predicted_std": "predicted_std", "augmented_unit": "unit"}
    view = campaign[["nees", "status", *(name for name in per_state if "unit" not in name)]]
    view = view.drop_vars(["parameter", "unit"], errors="ignore")
    view = view.rename({**per_state, "augmented": "parameter"})
    nowhere = xr.DataArray(np.full(view.sizes["parameter"], np.inf), dims="parameter")
    return summarize(view, nowhere.assign_coords(parameter=view["parameter"]))


def compare(
    a: xr.Dataset,
    b: xr.Dataset,
    *,
    resamples: int,
    seed: int,
    confidence: float = 0.95,
    bound: xr.DataArray | None = None,
) -> xr.Dataset:
    """RMSE of campaign `a` over that of campaign `b`, over the runs done in both.

    Parameters
    ----------
    a, b : xarray.Dataset
        Campaigns of the same simulated truths; see the module's description.
    resamples : int
        Bootstrap resamples.
    seed : int
        Of the resampling.
    confidence : float
    bound : xarray.DataArray, optional
        Accuracy bounds, on parameter.

    Returns
    -------
    xarray.Dataset
        On parameter: ratio; lower and upper, its pointwise interval; simultaneous_lower and
        simultaneous_upper, which hold for all parameters at once; p_ratio_above_one, Holm-adjusted
        over the parameters, small where `a` is worse; predicted_ratio, NaN unless both filters
        model the parameter; rmse_a and rmse_b. Scalar: runs_paired. With bounds also
        joint_share_a, joint_share_b, joint_difference and its interval, joint_difference_lower and
        joint_difference_upper, over the runs_judged that are done or failed in both: a failed run
        misses every bound.

    Raises
    ------
    ValueError
        If the parameters or the truths of the paired runs differ, fewer than two runs are done in
        both, a run marked done holds a value that is not finite, or a predicted standard
        deviation is negative or not finite.
    """
    if list(a["parameter"].values) != list(b["parameter"].values):
        raise ValueError("the campaigns have different parameters")
    done_a, done_b = _done(a), _done(b)
    runs = np.intersect1d(done_a["run"], done_b["run"])
    if len(runs) < 2:
        raise ValueError(f"{len(runs)} runs are done in both campaigns; a comparison needs two")
    done_a, done_b = done_a.sel(run=runs), done_b.sel(run=runs)
    _check_same_truth(done_a, done_b)

    error_a, error_b = done_a["error"].to_numpy(), done_b["error"].to_numpy()
    result = comparison_statistics.rmse_ratio(
        error_a,
        error_b,
        resamples=resamples,
        rng=np.random.default_rng(seed),
        confidence=confidence,
    )
    p = comparison_statistics.holm(comparison_statistics.p_value_ratio_above_one(error_a, error_b))
    std_a, std_b = _predicted_std(done_a), _predicted_std(done_b)
    predicted_ratio = np.full_like(std_a, np.nan)
    np.divide(std_a, std_b, out=predicted_ratio, where=(std_a > 0.0) & (std_b > 0.0))
    percent = f"{100 * confidence:g} %"
    both = f"simultaneous {percent} limit"
    columns = {
        "ratio": _variable(result.ratio, "RMSE of a over RMSE of b", "1"),
        "lower": _variable(result.lower, f"lower pointwise {percent} limit", "1"),
        "upper": _variable(result.upper, f"upper pointwise {percent} limit", "1"),
        "simultaneous_lower": _variable(result.simultaneous_lower, f"lower {both}", "1"),
        "simultaneous_upper": _variable(result.simultaneous_upper, f"upper {both}", "1"),
        "p_ratio_above_one": _variable(p, "Holm-adjusted p-value against ratio <= 1", "1"),
        "predicted_ratio": _variable(predicted_ratio, "predicted std of a over b", "1"),
        "rmse_a": _variable(statistics.rmse(error_a).value, "RMSE of a", _PARAMETER_UNIT),
        "rmse_b": _variable(statistics.rmse(error_b).value, "RMSE of b", _PARAMETER_UNIT),
        "runs_paired": _variable(len(runs), "runs done in both campaigns", "1"),
    }
    if bound is not None:
        columns |= _joint(a, b, bound, confidence)
    attrs = {"confidence": confidence, "resamples": resamples, "seed": seed}
    return xr.Dataset(columns, coords=_labels(done_a), attrs=attrs)


def _joint(
    a: xr.Dataset, b: xr.Dataset, bound: xr.DataArray, confidence: float
) -> dict[str, xr.Variable]:
    """Shares of runs that keep all bounds, paired."""
    made = [one["run"][np.isin(one["status"], (DONE, FAILED))].to_numpy() for one in (a, b)]
    runs, kept = np.intersect1d(made[0], made[1]), []
    for campaign in (a.sel(run=runs), b.sel(run=runs)):
        error = campaign["error"].transpose("run", "parameter").to_numpy()
        within = (np.abs(error) <= _bound_in_order(bound, campaign)).all(axis=1)
        kept.append((campaign["status"] == DONE).to_numpy() & within)
    found = comparison_statistics.share_difference(kept[0], kept[1], confidence)
    says = {
        "joint_share_a": (found.a, "share of runs of a that keep all bounds"),
        "joint_share_b": (found.b, "share of runs of b that keep all bounds"),
        "joint_difference": (found.difference, "the first less the second"),
        "joint_difference_lower": (found.lower, f"lower {100 * confidence:g} % limit"),
        "joint_difference_upper": (found.upper, f"upper {100 * confidence:g} % limit"),
        "runs_judged": (len(runs), "runs done or failed in both campaigns"),
    }
    return {name: _variable(value, text, "1") for name, (value, text) in says.items()}


def _done(campaign: xr.Dataset) -> xr.Dataset:
    """Keep the runs of status done, in memory and known to be finite."""
    per_run = ["truth", "estimate", "error", "nees"]
    is_done = (campaign["status"] == DONE).to_numpy()
    done = campaign[[*per_run, "predicted_std"]].isel(run=is_done).transpose("run", "parameter")
    done = done.load()
    for name in per_run:
        finite = np.isfinite(done[name].to_numpy())
        bad = ~finite.all(axis=tuple(range(1, finite.ndim)))
        if bad.any():
            run = int(done["run"].to_numpy()[bad][0])
            raise ValueError(f"run {run} is marked done but its {name} is not finite")
    return done


def _predicted_std(campaign: xr.Dataset) -> np.ndarray:
    predicted = campaign["predicted_std"].to_numpy()
    bad = ~(np.isfinite(predicted) & (predicted >= 0.0))
    if bad.any():
        name = str(campaign["parameter"].to_numpy()[bad][0])
        raise ValueError(f"the predicted standard deviation of {name} is negative or not finite")
    return predicted


def _bound_in_order(bound: xr.DataArray, campaign: xr.Dataset) -> np.ndarray:
    # By label: arithmetic on datasets would silently drop a parameter that has no bound.
    limit = bound.reindex(parameter=campaign["parameter"]).to_numpy()
    if np.isnan(limit).any():
        name = str(campaign["parameter"].to_numpy()[np.isnan(limit)][0])
        raise ValueError(f"parameter {name} has no accuracy bound")
    return limit


def _check_same_truth(a: xr.Dataset, b: xr.Dataset) -> None:
    truth_a, truth_b = a["truth"].to_numpy(), b["truth"].to_numpy()
    same = np.isclose(truth_a, truth_b, rtol=_TRUTH_TOLERANCE, atol=0.0).all(axis=1)
    if not same.all():
        run = int(a["run"].to_numpy()[~same][0])
        raise ValueError(f"run {run} has another truth in each campaign; they cannot be paired")


def _error_columns(error: np.ndarray, parameter: np.ndarray) -> dict[str, xr.Variable]:
    p95, p997 = (statistics.abs_error_quantile(error, level) for level in (0.95, 0.997))
    half_width = statistics.rmse_half_width_relative(error, CONFIDENCE)
    widest = int(np.argmax(half_width))
    return {
        **_with_mcse("bias", statistics.bias(error), "mean error", _PARAMETER_UNIT),
        **_with_mcse(
            "std",
            statistics.standard_deviation(error),
            "standard deviation of error",
            _PARAMETER_UNIT,
        ),
        **_with_interval(
            "rmse", statistics.rmse(error, CONFIDENCE), "root mean square error", _PARAMETER_UNIT
        ),
        "abs_error_p95": _variable(p95, "95 % quantile of |error|", _PARAMETER_UNIT),
        "abs_error_p997": _variable(p997, "99.7 % quantile of |error|", _PARAMETER_UNIT),
        "precision": _variable(half_width[widest], "worst relative half-width of RMSE", "1"),
        "least_precise": _variable(parameter[widest], "parameter it is of", ""),
    }


def _prediction_columns(error: np.ndarray, predicted: np.ndarray) -> dict[str, xr.Variable]:
    modelled = predicted > 0.0
    error, sigma = error[:, modelled], predicted[modelled]
    ratio = np.full(predicted.shape, np.nan)
    ratio[modelled] = statistics.rmse(error).value / sigma
    columns = {
        "predicted_std": _variable(predicted, "predicted standard deviation", _PARAMETER_UNIT),
        "rmse_over_predicted": _variable(ratio, "RMSE over predicted std", "1"),
        **_with_mcse(
            "model_error_percent",
            _filled(statistics.model_error_percent(error, sigma), modelled),
            "relative error of predicted std",
            "%",
        ),
        **_with_mcse(
            "bias_eliminated_coverage",
            _filled(statistics.bias_eliminated_coverage(error, 2 * sigma), modelled),
            "share of runs within 2 predicted sigma of the mean error",
            "1",
        ),
    }
    for count in (1, 2, 3):
        name = f"coverage_{count}_sigma"
        share = _filled(statistics.share_within(error, count * sigma, CONFIDENCE), modelled)
        columns |= _with_interval(name, share, f"share within {count} predicted sigma", "1")
        columns[name].attrs["nominal"] = statistics.nominal_coverage(count)
    columns["bias_eliminated_coverage"].attrs["nominal"] = statistics.nominal_coverage(2)
    return columns


def _bound_columns(error: np.ndarray, limit: np.ndarray, failed: int) -> dict[str, xr.Variable]:
    """Shares of all runs made: one that failed gave nothing, and misses every bound."""
    within, made = np.abs(error) <= limit, len(error) + failed
    share = statistics.wilson_interval(within.sum(axis=0), made, CONFIDENCE)
    joint = statistics.wilson_interval(within.all(axis=1).sum(), made, CONFIDENCE)
    return {
        "bound": _variable(limit, "accuracy bound", _PARAMETER_UNIT),
        **_with_interval("share_within_bound", share, "share of runs within bound", "1"),
        **_with_interval("joint_share", joint, "share of runs with all within bound", "1"),
    }


def _nees_scalars(nees: np.ndarray, dof: int) -> dict[str, xr.Variable]:
    lower, upper = statistics.nees_interval(len(nees), dof, CONFIDENCE) if dof else (np.nan,) * 2
    expected = f"95 % limit of the mean NEES of a consistent filter, {dof} degrees of freedom"
    return {
        "nees_mean": _variable(nees.mean() if dof else np.nan, "mean NEES", "1"),
        "nees_lower": _variable(lower, f"lower {expected}", "1"),
        "nees_upper": _variable(upper, f"upper {expected}", "1"),
    }


def _with_interval(
    name: str, bounded: Bounded, long_name: str, units: str
) -> dict[str, xr.Variable]:
    return {
        name: _variable(bounded.value, long_name, units),
        f"{name}_lower": _variable(bounded.lower, f"{long_name}, lower 95 % limit", units),
        f"{name}_upper": _variable(bounded.upper, f"{long_name}, upper 95 % limit", units),
    }


def _with_mcse(name: str, estimate: Estimate, long_name: str, units: str) -> dict[str, xr.Variable]:
    return {
        name: _variable(estimate.value, long_name, units),
        f"{name}_mcse": _variable(estimate.mcse, f"{long_name}, Monte Carlo standard error", units),
    }


def _filled(statistic: _Statistic, modelled: np.ndarray) -> _Statistic:
    """Give a statistic of the modelled parameters NaN for the others."""
    rows = np.full((len(statistic), modelled.size), np.nan)
    rows[:, modelled] = statistic
    return type(statistic)(*rows)


def _variable(values: np.ndarray | float, long_name: str, units: str) -> xr.Variable:
    array = np.asarray(values)
    attrs = {"long_name": long_name, "units": units}
    return xr.Variable(("parameter",) if array.ndim else (), array, attrs)


def _labels(campaign: xr.Dataset) -> dict[str, xr.DataArray]:
    return {name: campaign[name] for name in ("parameter", "unit")}
