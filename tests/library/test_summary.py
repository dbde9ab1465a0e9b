import numpy as np
import pytest
import xarray as xr
from conftest import paper_bounds, paper_truth
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from inscal import statistics
from inscal.parameters import COUNT, NAMES, UNITS
from inscal.statistics import wilson_interval
from inscal.summary import compare, summarize

SIGMA = paper_bounds() / 2.0
BOUND = xr.DataArray(paper_bounds(), {"parameter": list(NAMES)})


def campaign(error, status=None, predicted_std=SIGMA, truth=None):
    """Campaign of the given errors, shape (runs, 27); runs are numbered from 100."""
    runs = len(error)
    truth = np.tile(paper_truth(), (runs, 1)) if truth is None else truth
    status = np.ones(runs, np.int8) if status is None else np.asarray(status, np.int8)
    return xr.Dataset(
        {
            "truth": (("run", "parameter"), truth),
            "estimate": (("run", "parameter"), truth + error),
            "error": (("run", "parameter"), error),
            "predicted_std": ("parameter", predicted_std.copy()),
            "nees": ("run", np.square(error / predicted_std).sum(axis=1)),
            "status": ("run", status),
        },
        {
            "run": 100 + np.arange(runs),
            "parameter": list(NAMES),
            "unit": ("parameter", list(UNITS)),
        },
    )


def normal_errors(runs, seed, scale=1.0):
    return scale * SIGMA * np.random.default_rng(seed).standard_normal((runs, COUNT))


@pytest.fixture(scope="module")
def consistent():
    return summarize(campaign(normal_errors(2000, 1)), BOUND)


def test_consistent_filter_is_found_consistent(consistent):
    # All closed-form: errors are normal with the predicted standard deviation, half the bound.
    np.testing.assert_allclose(consistent["rmse_over_predicted"], 1.0, atol=4 / np.sqrt(4000))
    np.testing.assert_allclose(consistent["std"] / SIGMA, 1.0, atol=4 / np.sqrt(4000))
    np.testing.assert_allclose(consistent["bias"] / SIGMA, 0.0, atol=4 / np.sqrt(2000))
    np.testing.assert_allclose(consistent["bias_mcse"] / SIGMA, 1 / np.sqrt(2000), rtol=0.07)
    np.testing.assert_allclose(consistent["model_error_percent"], 0.0, atol=400 / np.sqrt(4000))
    np.testing.assert_allclose(consistent["abs_error_p95"] / SIGMA, 1.96, atol=0.2)
    np.testing.assert_allclose(consistent["abs_error_p997"] / SIGMA, 2.968, atol=0.6)
    within = stats.norm.cdf(2) - stats.norm.cdf(-2)
    scatter = 4 * np.sqrt(within * (1 - within) / 2000)
    for name in ("share_within_bound", "coverage_2_sigma", "bias_eliminated_coverage"):
        np.testing.assert_allclose(consistent[name], within, atol=scatter)
    joint = within**COUNT
    assert consistent["joint_share_lower"] < joint < consistent["joint_share_upper"]
    assert consistent["nees_lower"] < consistent["nees_mean"] < consistent["nees_upper"]
    assert consistent["nees_lower"] < COUNT < consistent["nees_upper"]
    assert consistent["precision"] == pytest.approx(1.386 / np.sqrt(2000), rel=0.15)
    half = ((consistent["rmse_upper"] - consistent["rmse_lower"]) / (2 * consistent["rmse"])).values
    assert consistent["precision"] == pytest.approx(half.max())
    assert consistent["least_precise"] == NAMES[half.argmax()]


def test_overconfident_filter_is_found_out():
    summary = summarize(campaign(normal_errors(500, 2, scale=2.0)), BOUND)
    assert summary["nees_mean"] > summary["nees_upper"]
    assert (summary["rmse_lower"] > summary["predicted_std"]).all()
    assert (summary["coverage_2_sigma_upper"] < 0.9545).all()
    assert summary["model_error_percent"].mean() == pytest.approx(-50.0, abs=1.0)


def test_small_campaign_by_hand():
    error = np.zeros((4, COUNT))
    # In units of the bound: inside, outside in one, outside in another, on the limit.
    error[:] = np.array([[0.5], [-0.5], [0.5], [1.0]]) * paper_bounds()
    error[1, 0] *= -3.0
    error[2, 5] *= 4.0
    summary = summarize(campaign(error, predicted_std=paper_bounds()), BOUND)
    assert summary["share_within_bound"].values[[0, 1, 5]] == pytest.approx([0.75, 1.0, 0.75])
    assert summary["joint_share"] == 0.5
    expected = statistics.wilson_interval(2, 4)
    assert summary["joint_share_lower"] == pytest.approx(expected.lower)
    rmse = np.sqrt(1.75 / 4) * paper_bounds()[1]
    assert summary["rmse"].sel(parameter=NAMES[1]) == pytest.approx(rmse)
    assert summary["rmse_over_predicted"].values[1] == pytest.approx(np.sqrt(1.75 / 4))
    assert summary["coverage_1_sigma"].values[5] == 0.75
    assert summary["coverage_2_sigma"].values[5] == 1.0


def test_only_runs_done_count_and_the_others_may_hold_anything():
    error = normal_errors(8, 3)
    status = [1, 2, 1, 0, 1, 2, 1, 2]
    all_done = summarize(campaign(error[::2]), BOUND)
    error[1::2] = np.nan
    summary = summarize(campaign(error, status), BOUND)
    assert (summary["runs_done"], summary["runs_failed"]) == (4, 3)
    others = [n for n in summary.data_vars if "share" in str(n)] + ["runs_failed"]
    xr.testing.assert_identical(summary.drop_vars(others), all_done.drop_vars(others))


def test_a_failed_run_misses_every_bound():
    error = normal_errors(8, 3)
    status = [1, 2, 1, 0, 1, 2, 1, 2]
    summary = summarize(campaign(error, status), BOUND)
    within = np.abs(error[::2]) <= BOUND.to_numpy()
    expected = wilson_interval(within.sum(axis=0), 7, 0.95)
    np.testing.assert_array_equal(summary["share_within_bound"], expected.value)
    np.testing.assert_array_equal(summary["share_within_bound_lower"], expected.lower)
    np.testing.assert_array_equal(summary["share_within_bound_upper"], expected.upper)
    joint = wilson_interval(within.all(axis=1).sum(), 7, 0.95)
    assert float(summary["joint_share"]) == joint.value
    assert float(summary["joint_share_upper"]) == joint.upper


@settings(deadline=None, max_examples=30)
@given(
    arrays(float, (4, COUNT), elements=st.floats(0.1, 10.0)),
    arrays(float, COUNT, elements=st.floats(0.01, 100.0)),
    st.permutations(range(4)),
)
def test_units_and_order_of_runs_cancel_in_pure_numbers(error, unit, order):
    error[0] += 11.0  # no parameter has the same error in every run
    before = summarize(campaign(error, predicted_std=np.ones(COUNT)), 2.1 + 0 * BOUND)
    after = summarize(campaign(unit * error, predicted_std=unit), 2.1 * unit + 0 * BOUND)
    shuffled = summarize(
        campaign(error, predicted_std=np.ones(COUNT)).isel(run=order), 2.1 + 0 * BOUND
    )
    for name in ("rmse_over_predicted", "nees_mean", "precision"):
        np.testing.assert_allclose(after[name], before[name], rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(shuffled[name], before[name], rtol=1e-9, atol=1e-12)
    for name in ("bias", "rmse", "rmse_upper", "abs_error_p95"):
        np.testing.assert_allclose(after[name], unit * before[name], rtol=1e-9)
        np.testing.assert_allclose(shuffled[name], before[name], rtol=1e-9)


def test_bound_is_matched_by_label():
    one = campaign(normal_errors(20, 4))
    xr.testing.assert_identical(summarize(one, BOUND[::-1]), summarize(one, BOUND))


def test_order_of_dimensions_does_not_matter():
    one = campaign(normal_errors(20, 5))
    xr.testing.assert_identical(
        summarize(one.transpose("parameter", "run"), BOUND), summarize(one, BOUND)
    )


def test_every_variable_is_named_and_flat(consistent):
    for variable in consistent.data_vars.values():
        assert variable.dims in (("parameter",), ())
        assert variable.attrs["long_name"]
        if variable.dtype.kind == "f":
            assert variable.attrs["units"] in ("1", "%", "see coordinate unit")
    assert consistent["coverage_3_sigma"].attrs["nominal"] == pytest.approx(0.9973, abs=1e-5)
    assert list(consistent["unit"].values) == list(UNITS)
    table = consistent.to_dataframe()
    assert list(table.index) == list(NAMES)
    assert table["rmse"].to_numpy() == pytest.approx(consistent["rmse"].to_numpy())


def test_one_run_gives_shares_but_no_scatter():
    summary = summarize(campaign(normal_errors(1, 6)), BOUND)
    assert summary["runs_done"] == 1
    assert np.isfinite(summary["share_within_bound_lower"]).all()
    assert np.isnan(summary["std"]).all()
    assert not summary["precision"] < 1e9


def test_parameters_not_modelled_have_errors_but_no_prediction_to_hold_them_against():
    one = campaign(normal_errors(30, 22))
    whole = summarize(one, BOUND)
    one["predicted_std"][[4, 9]] = 0.0
    partial = summarize(one, BOUND)
    modelled = (partial["predicted_std"] > 0.0).values
    assert (~modelled).nonzero()[0].tolist() == [4, 9]
    prediction = [n for n in whole if str(n).startswith(("coverage", "model", "bias_elim"))]
    assert len(prediction) == 13
    for name in [*prediction, "rmse_over_predicted"]:
        assert np.isnan(partial[name][~modelled]).all()
        xr.testing.assert_identical(partial[name][modelled], whole[name][modelled])
    for name in ("bias", "rmse_upper", "share_within_bound", "joint_share", "precision"):
        xr.testing.assert_identical(partial[name], whole[name])
    limits = statistics.nees_interval(30, COUNT - 2)
    assert (partial["nees_lower"], partial["nees_upper"]) == pytest.approx(limits)

    other = campaign(normal_errors(30, 23))
    other["predicted_std"][7] = 0.0
    ratio = compare(one, other, resamples=50, seed=1)["predicted_ratio"]
    assert np.isnan(ratio).values.nonzero()[0].tolist() == [4, 7, 9]
    assert ratio.sum() == pytest.approx(COUNT - 3)


def test_campaign_without_a_run_done_is_refused():
    with pytest.raises(ValueError, match="no run of the campaign is done"):
        summarize(campaign(normal_errors(3, 7), status=[0, 2, 2]), BOUND)


@pytest.mark.parametrize("name", ["truth", "estimate", "error", "nees"])
def test_run_done_with_a_hole_is_named(name):
    broken = campaign(normal_errors(4, 8))
    broken[name][2, ...] = np.nan
    with pytest.raises(ValueError, match=f"run 102 .* {name} "):
        summarize(broken, BOUND)


def test_missing_bound_and_useless_prediction_are_named():
    one = campaign(normal_errors(4, 9))
    with pytest.raises(ValueError, match=f"{NAMES[3]} has no accuracy bound"):
        summarize(one, BOUND.drop_sel(parameter=NAMES[3]))
    one["predicted_std"][5] = -1.0
    with pytest.raises(ValueError, match=f"{NAMES[5]} is negative"):
        summarize(one, BOUND)


# Comparison


def test_comparison_finds_the_one_parameter_made_worse():
    base = normal_errors(300, 20)
    own = normal_errors(300, 21)
    other = 0.8 * base + 0.6 * own
    other[:, 4] *= 1.5
    # At a confidence at which one false alarm among the other 26 is not to be expected.
    a, b = campaign(other, predicted_std=3 * SIGMA), campaign(base)
    result = compare(a, b, resamples=5000, seed=1, confidence=0.999)
    worse = np.arange(COUNT) == 4
    np.testing.assert_array_equal(result["simultaneous_lower"] > 1.0, worse)
    np.testing.assert_array_equal(result["p_ratio_above_one"] < 0.001, worse)
    # Four standard errors of the log ratio, 0.6 / sqrt(300).
    expected = np.where(worse, 1.5, 1.0)
    np.testing.assert_allclose(result["ratio"], expected, rtol=4 * 0.6 / np.sqrt(300))
    np.testing.assert_allclose(result["ratio"], result["rmse_a"] / result["rmse_b"])
    np.testing.assert_allclose(result["predicted_ratio"], 3.0)
    assert (result["simultaneous_lower"] < result["lower"]).all()
    assert (result["simultaneous_upper"] > result["upper"]).all()
    assert result["runs_paired"] == 300
    assert list(result["unit"].values) == list(UNITS)


def test_comparison_pairs_by_run_and_uses_the_runs_done_in_both():
    error = normal_errors(40, 12)
    truth = np.random.default_rng(13).standard_normal((40, COUNT))
    status = np.ones(40)
    status[[3, 17]] = 2
    a = campaign(error, status, truth=truth)
    b = campaign(2.0 * error, truth=truth).isel(run=np.random.default_rng(14).permutation(35))
    result = compare(a, b, resamples=100, seed=1)
    assert result["runs_paired"] == 33
    # Twice the error in every run: pairing leaves no scatter at all.
    for name in ("ratio", "lower", "upper", "simultaneous_lower", "simultaneous_upper"):
        np.testing.assert_allclose(result[name], 0.5, rtol=1e-9)
    np.testing.assert_array_equal(result["p_ratio_above_one"], 1.0)


def test_comparison_is_reproducible_and_hangs_on_its_seed():
    a, b = campaign(normal_errors(50, 15)), campaign(normal_errors(50, 16))
    first = compare(a, b, resamples=200, seed=1)
    xr.testing.assert_identical(first, compare(a, b, resamples=200, seed=1))
    assert (first["lower"] != compare(a, b, resamples=200, seed=2)["lower"]).all()


def test_wider_confidence_gives_wider_intervals():
    a, b = campaign(normal_errors(50, 17)), campaign(normal_errors(50, 18))
    usual = compare(a, b, resamples=400, seed=1)
    wide = compare(a, b, resamples=400, seed=1, confidence=0.99)
    assert (wide["lower"] < usual["lower"]).all()
    assert (wide["simultaneous_upper"] > usual["simultaneous_upper"]).all()


def test_campaigns_that_do_not_pair_are_refused():
    one = campaign(normal_errors(5, 19))
    with pytest.raises(ValueError, match="different parameters"):
        compare(one, one.isel(parameter=slice(5)), resamples=10, seed=1)
    with pytest.raises(ValueError, match="1 runs are done in both"):
        compare(one, one.isel(run=[2]), resamples=10, seed=1)
    other = one.copy(deep=True)
    other["truth"][3, 8] *= 1.0 + 1e-6
    with pytest.raises(ValueError, match="run 103 has another truth"):
        compare(one, other, resamples=10, seed=1)


def test_shares_within_bounds_are_of_pairs_that_are_done_or_failed_in_both():
    within, beyond = np.zeros(COUNT), 3.0 * paper_bounds()
    a = campaign(np.array([within, within, within, beyond, within]), [1, 1, 2, 1, 0])
    b = campaign(np.array([within, beyond, within, within, beyond]), [1, 1, 1, 1, 1])
    for one in (a, b):
        one["error"] += 1e-3 * SIGMA  # a ratio of RMSE needs errors
    found = compare(a, b, resamples=200, seed=1, bound=BOUND)
    assert int(found.runs_judged) == 4
    assert float(found.joint_share_a) == 0.5  # the failed run misses every bound
    assert float(found.joint_share_b) == 0.75
    assert float(found.joint_difference_lower) < -0.25 < float(found.joint_difference_upper)
    assert "joint_share_a" not in compare(a, b, resamples=200, seed=1)
