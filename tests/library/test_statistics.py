"""Every statistic against something independent of it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from repeated_samples import ERRORS, held, tolerance
from scipy import stats
from scipy.stats import binomtest

from inscal import statistics

# Error statistics


def test_exact_values_of_a_small_sample():
    error = np.array([[1.0, 10.0], [3.0, -10.0], [5.0, 30.0]])
    assert statistics.bias(error).value == pytest.approx([3.0, 10.0])
    assert statistics.standard_deviation(error).value == pytest.approx([2.0, 20.0])
    assert statistics.rmse(error).value == pytest.approx(np.sqrt([35 / 3, 1100 / 3]))
    # Beyond the sample the quantile is the largest |error|.
    assert statistics.abs_error_quantile(-error, 0.997) == pytest.approx([5.0, 30.0])
    percent = statistics.model_error_percent(error, [2.2, 10.0])
    assert percent.value == pytest.approx([10.0, -50.0])
    # Two of {-2, 0, 2} and one of {0, -20, 20} are within the half-widths of the mean.
    coverage = statistics.bias_eliminated_coverage(error, [2.0, 19.0])
    assert coverage.value == pytest.approx([1.0, 1 / 3])
    assert coverage.mcse == pytest.approx([0.0, np.sqrt(2 / 27)])


@pytest.mark.parametrize(
    "statistic",
    [
        statistics.bias,
        statistics.standard_deviation,
        lambda error: statistics.model_error_percent(error, np.full(error.shape[1], 3.0)),
        lambda error: statistics.bias_eliminated_coverage(error, np.full(error.shape[1], 1.5)),
    ],
)
def test_monte_carlo_standard_error_is_the_scatter_between_campaigns(statistic):
    campaigns, runs = 20000, 60
    # Columns are as good as campaigns: the statistics are vectorised over them.
    error = np.random.default_rng(1).normal(0.5, 1.5, (runs, campaigns))
    value, mcse = statistic(error)
    # 4/sqrt(2 campaigns) for the scatter, a like share for the mean, and 1/runs for its bias.
    assert np.sqrt(np.mean(mcse**2)) == pytest.approx(value.std(), rel=0.04 + 1 / runs)


NORMAL = (lambda rng, size: rng.normal(0.0, 2.0, size), 2.0)
BIASED = (lambda rng, size: rng.normal(3.0, 1.0, size), np.sqrt(10.0))
UNIFORM = (lambda rng, size: rng.uniform(-3.0, 3.0, size), np.sqrt(3.0))
LONG_TAILED = (lambda rng, size: rng.standard_t(6, size), np.sqrt(1.5))


@pytest.mark.parametrize(
    ("errors", "runs", "coverage"),
    [
        *((NORMAL, runs, (0.945, 0.955)) for runs in (3, 10, 32, 100, 500)),
        *((errors, runs, (0.945, 1.0)) for errors in (BIASED, UNIFORM) for runs in (3, 32, 500)),
        (LONG_TAILED, 10, (0.86, 0.90)),
        (LONG_TAILED, 500, (0.92, 0.95)),
    ],
)
def test_rmse_interval_holds_at_any_number_of_runs(errors, runs, coverage):
    (draw, truth), trials = errors, 4000
    _, lower, upper = statistics.rmse(draw(np.random.default_rng(2), (runs, trials)))
    least, most = coverage
    share, doubt = held(lower, truth, upper), tolerance(0.95, trials)
    assert least - doubt <= share <= most + doubt


def test_rmse_interval_of_normal_errors_is_near_the_exact_chi_square_one():
    error = np.random.default_rng(3).standard_normal((2000, 50))
    value, lower, upper = statistics.rmse(error, 0.9)
    exact = value[:, None] * np.sqrt(2000 / stats.chi2.ppf([0.95, 0.05], 2000))
    np.testing.assert_allclose(np.column_stack([lower, upper]), exact, rtol=0.01)
    width = statistics.rmse_half_width_relative(error, 0.9)
    assert width == pytest.approx((upper - lower) / (2 * value))
    assert width.mean() == pytest.approx(1.645 / np.sqrt(2 * 2000), rel=0.03)


def test_abs_error_quantile_is_median_unbiased_in_the_tail():
    trials = 20000
    error = np.random.default_rng(4).standard_normal((200, trials))
    truth = stats.norm.ppf(0.975)
    low = (statistics.abs_error_quantile(error, 0.95) < truth).mean()
    # The usual linear quantile is low in 57 % of the trials.
    assert low == pytest.approx(0.5, abs=tolerance(0.5, trials) + 0.005)


def test_one_run_has_a_bias_but_no_scatter():
    error = np.array([[2.0, -3.0]])
    assert statistics.bias(error).value == pytest.approx([2.0, -3.0])
    assert statistics.rmse(error).value == pytest.approx([2.0, 3.0])
    assert np.isnan(statistics.standard_deviation(error)).all()
    assert np.isnan(statistics.rmse_half_width_relative(error)).all()


@settings(deadline=None)
@given(ERRORS, st.floats(0.001, 1000.0), st.randoms(use_true_random=False))
def test_statistics_scale_with_the_unit_and_ignore_the_order_of_runs(error, unit, random):
    order = random.sample(range(len(error)), len(error))
    other = unit * error[order]
    for statistic in (statistics.bias, statistics.standard_deviation, statistics.rmse):
        for before, after in zip(statistic(error), statistic(other), strict=True):
            np.testing.assert_allclose(after, unit * before, rtol=1e-9, atol=1e-9 * unit)
    width = statistics.rmse_half_width_relative(error)
    np.testing.assert_allclose(
        statistics.rmse_half_width_relative(other), width, rtol=1e-9, atol=1e-12
    )


@settings(deadline=None)
@given(ERRORS)
def test_mean_square_is_bias_and_variance(error):
    runs = len(error)
    spread, offset = statistics.standard_deviation(error).value, statistics.bias(error).value
    square = offset**2 + spread**2 * (runs - 1) / runs
    np.testing.assert_allclose(statistics.rmse(error).value ** 2, square, rtol=1e-9)


@pytest.mark.parametrize("error", [np.ones(3), np.ones((0, 3)), np.array([[1.0, np.nan]])])
def test_unfit_errors_are_refused(error):
    with pytest.raises(ValueError, match="errors"):
        statistics.bias(error)


@pytest.mark.parametrize("confidence", [0.0, 1.0, 95.0])
def test_confidence_that_is_no_probability_is_refused(confidence):
    with pytest.raises(ValueError, match="between 0 and 1"):
        statistics.rmse(np.ones((3, 1)), confidence)


# Shares


def test_wilson_interval_has_the_published_values():
    # Newcombe (1998), Statistics in Medicine 17:857-872, Table I, method 3.
    share, lower, upper = statistics.wilson_interval([81, 15, 0, 1], [263, 148, 20, 29])
    assert share == pytest.approx([81 / 263, 15 / 148, 0.0, 1 / 29])
    assert lower == pytest.approx([0.2553, 0.0624, 0.0, 0.0061], abs=6e-5)
    assert upper == pytest.approx([0.3662, 0.1605, 0.1611, 0.1718], abs=6e-5)


@settings(deadline=None)
@given(st.integers(1, 2000).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_wilson_interval_is_that_of_scipy(counts):
    expected = binomtest(*counts).proportion_ci(0.9, method="wilson")
    _, lower, upper = statistics.wilson_interval(*counts, 0.9)
    assert (lower, upper) == pytest.approx((expected.low, expected.high), abs=1e-12)


@pytest.mark.parametrize(("successes", "trials"), [(-1, 3), (4, 3), (0, 0)])
def test_impossible_counts_are_refused(successes, trials):
    with pytest.raises(ValueError, match="successes"):
        statistics.wilson_interval(successes, trials)


def test_share_within_counts_the_limit_itself():
    error = np.array([[1.0, 0.0], [-2.0, 5.0], [2.1, -5.1], [0.0, 4.0]])
    share = statistics.share_within(error, [2.0, 5.0])
    assert share.value == pytest.approx([0.75, 0.75])
    expected = statistics.wilson_interval(3, 4)
    assert share.lower == pytest.approx([expected.lower] * 2)


def test_coverage_of_k_sigma_is_nominal_and_its_interval_holds():
    trials = 2000
    error = np.random.default_rng(5).normal(0.0, 3.0, (300, trials))
    for sigmas, nominal in ((1, 0.682689), (2, 0.954500), (3, 0.997300)):
        assert statistics.nominal_coverage(sigmas) == pytest.approx(nominal, abs=1e-6)
        share = statistics.nominal_coverage(sigmas)
        assert statistics.normal_quantile(share) == pytest.approx(sigmas, rel=1e-9)
        share, lower, upper = statistics.share_within(error, np.full(trials, 3.0 * sigmas))
        assert share.mean() == pytest.approx(nominal, abs=tolerance(nominal, error.size))
        counts = np.arange(301)
        _, low, high = statistics.wilson_interval(counts, 300)
        exact = stats.binom.pmf(counts, 300, nominal)[(low <= nominal) & (nominal <= high)].sum()
        assert held(lower, nominal, upper) == pytest.approx(exact, abs=tolerance(exact, trials))
        assert exact == pytest.approx(0.95, abs=0.02)


def test_bias_eliminated_coverage_tells_bias_from_spread():
    error = np.random.default_rng(6).normal([[5.0, 0.0]], [[1.0, 3.0]], (4000, 2))
    plain = statistics.share_within(error, [2.0, 2.0]).value
    centred = statistics.bias_eliminated_coverage(error, [2.0, 2.0]).value
    assert plain[0] == pytest.approx(0.00135, abs=0.003)
    assert centred == pytest.approx([0.9545, 0.4950], abs=tolerance(0.5, 4000))


# Consistency


def test_nees_of_a_known_ellipse():
    # P^-1 = [[2, -1], [-1, 2]] / 3.
    covariance = np.array([[2.0, 1.0], [1.0, 2.0]])
    error = np.array([[1.0, 0.0], [1.0, 1.0], [3.0, -3.0]])
    expected = [2 / 3, 2 / 3, 18.0]
    assert statistics.nees(error, covariance) == pytest.approx(expected)
    each = covariance * np.array([1.0, 2.0, 3.0])[:, None, None]
    assert statistics.nees(error, each) == pytest.approx([2 / 3, 1 / 3, 6.0])


def test_nees_refuses_what_is_no_covariance():
    with pytest.raises(np.linalg.LinAlgError):
        statistics.nees(np.ones((2, 2)), [[1.0, 2.0], [2.0, 1.0]])


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_nees_is_invariant_under_linear_maps(seed):
    rng = np.random.default_rng(seed)
    root, change = rng.standard_normal((2, 4, 4)) + 5.0 * np.eye(4)
    error, covariance = rng.standard_normal((6, 4)), root @ root.T
    mapped = statistics.nees(error @ change.T, change @ covariance @ change.T)
    np.testing.assert_allclose(mapped, statistics.nees(error, covariance), rtol=1e-6)


def test_nees_interval_has_the_published_values():
    # Bar-Shalom et al. (2001), sec. 5.4: 50 runs of dimension 2, chi-square table of 100 degrees.
    one = stats.chi2.ppf([0.025, 0.975], 3)
    assert statistics.nees_interval(1, 3) == pytest.approx(tuple(one), rel=1e-9)
    assert statistics.nees_interval(50, 2) == pytest.approx((74.222 / 50, 129.561 / 50), abs=1e-4)
    with pytest.raises(ValueError, match="positive"):
        statistics.nees_interval(0, 2)


def test_mean_nees_of_a_linear_gaussian_filter_lies_in_its_interval():
    trials, runs = 3000, 20
    rng = np.random.default_rng(7)
    # Static estimate of x ~ N(0, P0) from z = H x + v: the textbook posterior covariance.
    prior, H, R = np.diag([4.0, 1.0, 9.0]), np.array([[1.0, 2.0, 0.0], [0.0, 1.0, 1.0]]), np.eye(2)
    S = H @ prior @ H.T + R
    gain = prior @ H.T @ np.linalg.inv(S)
    x = rng.standard_normal((trials * runs, 3)) @ np.sqrt(prior)
    z = x @ H.T + rng.standard_normal((trials * runs, 2))
    lower, upper = statistics.nees_interval(runs, 3)
    nees = statistics.nees(z @ gain.T - x, prior - gain @ H @ prior)
    share = held(lower, nees.reshape(trials, runs).mean(axis=1), upper)
    assert share == pytest.approx(0.95, abs=tolerance(0.95, trials))
    nis = statistics.nees(z, np.broadcast_to(S, (len(z), 2, 2)))
    lower, upper = statistics.nees_interval(runs, 2)
    share = held(lower, nis.reshape(trials, runs).mean(axis=1), upper)
    assert share == pytest.approx(0.95, abs=tolerance(0.95, trials))
