"""Paired comparison against something independent of it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from repeated_samples import ERRORS, held, tolerance
from scipy import stats

from inscal import comparison_statistics as comparison


def paired(rng, runs, ratio, parameters=27):
    """Errors of which a is `ratio` times as large as b, correlated 0.8 run by run."""
    b, own = rng.standard_normal((2, runs, parameters))
    return ratio * (0.8 * b + 0.6 * own), b


def compare(a, b, seed=0, resamples=400):
    rng = np.random.default_rng(seed)
    return comparison.rmse_ratio(a, b, resamples=resamples, rng=rng)


def test_ratio_intervals_hold_at_their_level():
    rng, trials, ratio = np.random.default_rng(9), 300, np.linspace(0.5, 2.0, 27)
    pointwise, simultaneous = [], []
    for trial in range(trials):
        result = compare(*paired(rng, 200, ratio), seed=trial)
        pointwise.append(held(result.lower, ratio, result.upper))
        low, high = result.simultaneous_lower, result.simultaneous_upper
        simultaneous.append(held(low, ratio, high) == 1.0)
    # A percentile interval holds about 1 % less than it says at 200 runs.
    assert np.mean(pointwise) == pytest.approx(0.945, abs=tolerance(0.95, 27 * trials) + 0.005)
    assert np.mean(simultaneous) == pytest.approx(0.955, abs=tolerance(0.95, trials))


def test_simultaneous_interval_is_that_of_bonferroni_for_independent_parameters():
    a, b = paired(np.random.default_rng(10), 2000, 1.0)
    result = compare(a, b, resamples=4000)
    # Delta method for equal normal variances: var log ratio = (1 - correlation^2) / runs.
    se = 0.6 / np.sqrt(2000)
    half = np.log(result.simultaneous_upper / result.ratio)
    assert half.mean() == pytest.approx(stats.norm.ppf(0.5 + 0.95 ** (1 / 27) / 2) * se, rel=0.05)
    half = np.log(result.upper / result.lower) / 2
    assert half.mean() == pytest.approx(1.96 * se, rel=0.05)


@settings(deadline=None)
@given(ERRORS, st.floats(0.01, 100.0))
def test_units_cancel_in_the_ratio(error, unit):
    other = error[::-1] + 1.0
    mine, theirs = compare(error, other, resamples=50), compare(unit * error, unit * other, 0, 50)
    for name in ("ratio", "lower", "upper"):
        np.testing.assert_allclose(getattr(theirs, name), getattr(mine, name), rtol=1e-9)


def test_what_is_the_same_in_both_has_a_ratio_without_width():
    a, b = paired(np.random.default_rng(11), 50, 1.0, parameters=3)
    free = compare(a[:, 1:], b[:, 1:])
    a[:, 0] = -b[:, 0]
    result = compare(a, b)
    assert (result.lower[0], result.upper[0]) == pytest.approx((1.0, 1.0))
    assert (result.simultaneous_lower[0], result.simultaneous_upper[0]) == pytest.approx((1, 1))
    np.testing.assert_allclose(result.simultaneous_upper[1:], free.simultaneous_upper)


def test_intervals_are_those_of_a_loop_over_resampled_runs():
    a, b = paired(np.random.default_rng(15), 12, 1.3, parameters=3)
    rng, runs = np.random.default_rng(0), np.arange(12)

    def log_ratio_and_se(rows):
        square_a, square_b = np.square(a[rows]), np.square(b[rows])
        mean_a, mean_b = square_a.mean(axis=0), square_b.mean(axis=0)
        influence = (square_a / mean_a - square_b / mean_b) / 2
        return np.log(mean_a / mean_b) / 2, influence.std(axis=0) / np.sqrt(12)

    value, se = log_ratio_and_se(runs)
    drawn = [np.repeat(runs, rng.multinomial(12, np.full(12, 1 / 12))) for _ in range(400)]
    log_ratio, each_se = (np.array(x) for x in zip(*map(log_ratio_and_se, drawn), strict=True))
    largest = np.max(np.abs(log_ratio - value) / each_se, axis=1)
    critical = np.quantile(largest, 0.95, method="higher")
    result = compare(a, b)
    np.testing.assert_allclose(result.ratio, np.exp(value))
    np.testing.assert_allclose(result.lower, np.exp(np.quantile(log_ratio, 0.025, axis=0)))
    np.testing.assert_allclose(result.upper, np.exp(np.quantile(log_ratio, 0.975, axis=0)))
    np.testing.assert_allclose(result.simultaneous_lower, np.exp(value - critical * se))
    np.testing.assert_allclose(result.simultaneous_upper, np.exp(value + critical * se))


@pytest.mark.parametrize("weights", [40 * 7, 7])
def test_blocks_of_resamples_change_nothing(monkeypatch, weights):
    """Not even where so many runs leave room for less than one resample."""
    a, b = paired(np.random.default_rng(12), 40, 1.3)
    whole = compare(a, b)
    monkeypatch.setattr(comparison, "_BLOCK_WEIGHTS", weights)
    np.testing.assert_allclose(compare(a, b).simultaneous_lower, whole.simultaneous_lower)


def test_p_value_is_uniform_under_the_null_and_finds_the_alternative():
    rng = np.random.default_rng(13)
    p = comparison.p_value_ratio_above_one(*paired(rng, 300, 1.0, parameters=5000))
    for level in (0.01, 0.05, 0.5):
        assert (p < level).mean() == pytest.approx(level, abs=tolerance(level, p.size) + 0.002)
    # A ratio of 1.1 is 2.8 standard errors of 0.6 / sqrt(300) away in its logarithm.
    p = comparison.p_value_ratio_above_one(*paired(rng, 300, 1.1, parameters=2000))
    power = stats.norm.sf(1.645 - np.log(1.1) * np.sqrt(300) / 0.6)
    assert (p < 0.05).mean() == pytest.approx(power, abs=0.05)
    better = comparison.p_value_ratio_above_one(*paired(rng, 300, 0.9, parameters=2000))
    assert (better < 0.05).mean() < 0.001


def test_p_value_is_that_of_the_paired_t_test():
    rng = np.random.default_rng(11)
    for runs in (2, 3, 128, 1000):
        a, b = paired(rng, runs, 1.05, parameters=27)
        expected = stats.ttest_rel(a**2, b**2, alternative="greater").pvalue
        np.testing.assert_allclose(
            comparison.p_value_ratio_above_one(a, b), expected, rtol=1e-12, atol=0.0
        )


def test_p_value_of_differences_all_alike():
    a, b = np.full((4, 2), 2.0), np.full((4, 2), 1.0)
    assert comparison.p_value_ratio_above_one(a, b).tolist() == [0.0, 0.0]
    assert comparison.p_value_ratio_above_one(b, a).tolist() == [1.0, 1.0]


def test_p_value_of_identical_errors_is_one():
    a, b = paired(np.random.default_rng(14), 30, 2.0, parameters=2)
    a[:, 0] = b[:, 0]
    p = comparison.p_value_ratio_above_one(a, b)
    assert p[0] == 1.0
    assert p[1] < 0.01


def test_holm_adjusts_as_in_a_worked_example():
    # 4 x 0.005, 3 x 0.01, 2 x 0.03, and 0.04 raised to the one before it.
    assert comparison.holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert comparison.holm([0.9, 0.8]) == pytest.approx([1.0, 1.0])
    with pytest.raises(ValueError, match="p-values"):
        comparison.holm([0.1, np.nan])


def test_pairs_that_cannot_be_compared_are_refused():
    with pytest.raises(ValueError, match="shapes"):
        compare(np.ones((3, 2)), np.ones((4, 2)))
    with pytest.raises(ValueError, match="two runs"):
        compare(np.ones((1, 2)), np.ones((1, 2)))
    with pytest.raises(ValueError, match="resamples"):
        compare(np.ones((3, 2)), np.ones((3, 2)), resamples=1)


@pytest.mark.parametrize(
    ("both", "only_a", "only_b"), [(0.95, 0.03, 0.005), (0.5, 0.2, 0.2), (0.98, 0.0, 0.01)]
)
def test_interval_of_a_share_difference_covers_as_often_as_it_says(both, only_a, only_b):
    rng = np.random.default_rng(8)
    cells = [both, only_a, only_b, 1.0 - both - only_a - only_b]
    covered = 0
    for _ in range(1500):
        outcome = rng.choice(4, size=300, p=cells)
        found = comparison.share_difference(outcome <= 1, outcome % 2 == 0)
        covered += found.lower <= only_a - only_b <= found.upper
    assert 0.93 < covered / 1500 < 0.99


def test_share_difference_of_known_runs():
    a, b = [True, True, True, False], [True, False, True, False]
    found = comparison.share_difference(a, b)
    assert (found.a, found.b, found.difference) == (0.75, 0.5, 0.25)
    assert found.lower < 0.0 < found.difference < found.upper
    assert comparison.share_difference(b, a).lower == pytest.approx(-found.upper)
