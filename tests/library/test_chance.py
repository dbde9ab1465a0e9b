"""Exact tests against scipy's own and against repeated draws."""

import numpy as np
import pytest
from repeated_samples import held, tolerance
from scipy import stats

from inscal import chance

COUNTS = [(0, 5), (5, 5), (3, 500), (498, 500), (41, 120)]


@pytest.mark.parametrize(("hits", "trials"), COUNTS)
def test_clopper_pearson_is_that_of_scipy(hits, trials):
    share, lower, upper = chance.clopper_pearson(hits, trials, 0.9)
    expected = stats.binomtest(hits, trials).proportion_ci(0.9, method="exact")
    assert share == hits / trials
    assert (lower, upper) == pytest.approx((expected.low, expected.high), abs=1e-12)


@pytest.mark.parametrize(("hits", "trials"), COUNTS)
def test_binomial_p_and_interval_say_the_same(hits, trials):
    _, lower, upper = chance.clopper_pearson(hits, trials, 0.95)
    for share in (0.01, 0.3, 0.99, 0.9973):
        tails = stats.binom.cdf(hits, trials, share), stats.binom.sf(hits - 1, trials, share)
        p = chance.binomial_p(hits, trials, share)
        assert p == pytest.approx(min(2 * min(tails), 1.0))
        assert (p < 0.05) == (not lower <= share <= upper)


def test_p_values_are_those_of_scipy():
    total, dof = np.array([3.0, 27.0, 60.0]), np.array([1, 27, 27])
    tails = stats.chi2.cdf(total, dof), stats.chi2.sf(total, dof)
    np.testing.assert_allclose(chance.chi_square_p(total, dof), 2 * np.minimum(*tails))
    np.testing.assert_allclose(chance.too_long_p(total, dof), tails[1])
    t = np.array([-3.1, 0.0, 2.0])
    np.testing.assert_allclose(chance.student_p(t, 7), 2 * stats.t.sf(np.abs(t), 7))
    low, high = chance.chi_square_limits(12, 0.9)
    assert (12 * low, 12 * high) == pytest.approx(stats.chi2.ppf([0.05, 0.95], 12))


def test_distribution_p_is_near_the_exact_one_and_uniform():
    rng = np.random.default_rng(1)
    found = np.array([chance.distribution_p(rng.chisquare(27, 60), 27) for _ in range(2000)])
    for level in (0.01, 0.05, 0.3):
        assert (found < level).mean() == pytest.approx(level, abs=tolerance(level, 2000) + 0.003)
    values = rng.chisquare(27, 400)
    exact = stats.kstest(values, stats.chi2(27).cdf, method="exact").pvalue
    assert chance.distribution_p(values, 27) == pytest.approx(exact, abs=0.01)
    assert chance.distribution_p(1.2 * values, 27) < 1e-6


def test_rmse_of_normal_errors_holds_as_often_as_it_says():
    error = np.random.default_rng(2).normal(0.0, 3.0, (4, 5000))
    value, lower, upper = chance.rmse_of_normal(error, 0.9)
    np.testing.assert_allclose(value, np.sqrt(np.square(error).mean(axis=0)))
    assert held(lower, 3.0, upper) == pytest.approx(0.9, abs=tolerance(0.9, 5000))


@pytest.mark.parametrize(("dof", "too_small"), [(30, 0.3), (500, 0.05), (13_500, 0.02)])
def test_power_is_the_share_of_draws_that_are_found(dof, too_small):
    level, rng = 0.01, np.random.default_rng(3)
    total = rng.chisquare(dof, 20_000) / (1.0 - too_small) ** 2
    found = (chance.chi_square_p(total, dof) < level).mean()
    assert chance.scale_power(dof, too_small, level) == pytest.approx(
        found, abs=tolerance(found, 20_000)
    )


def test_without_an_error_power_is_the_level():
    assert chance.scale_power(500, 0.0, 0.01) == pytest.approx(0.01)


def test_smallest_seen_is_seen_as_often_as_asked():
    for dof in (100, 500, 13_500):
        seen = chance.smallest_seen(dof, 1e-3, 0.9)
        assert chance.scale_power(dof, seen, 1e-3) == pytest.approx(0.9, abs=1e-6)
