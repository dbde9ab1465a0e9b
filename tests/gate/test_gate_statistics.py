"""The gate's statistics: its ratios and checks against textbooks and samples."""

from dataclasses import replace

import numpy as np
import pytest
from normal_samples import normal_errors, some_covariance
from scipy import stats

from inscal import campaign_checks, regression
from inscal.campaign_checks import LOOKS, Sample
from inscal.parameters import COUNT, NAMES


def test_paired_ratio_is_pitmans_and_morgans_test_of_a_single_parameter():
    covariance = some_covariance()
    rng = np.random.default_rng(2)
    old = normal_errors(rng, covariance, 30)
    new = 1.3 * old + 0.5 * normal_errors(rng, covariance, 30)
    ratios = regression.paired_ratio(old, new, covariance)
    allowed = 1 + regression.TOLERANCE
    for i in range(COUNT):
        u, v = new[:, i] / allowed + old[:, i], new[:, i] / allowed - old[:, i]
        r = u @ v / np.sqrt(u @ u * (v @ v))
        p = stats.t.sf(r * np.sqrt(29 / (1 - r**2)), 29)
        assert ratios.p_worse[i] == pytest.approx(p, rel=1e-8)
        rms = np.sqrt((new[:, i] @ new[:, i]) / (old[:, i] @ old[:, i]))
        assert ratios.ratio[i] == pytest.approx(rms, rel=1e-12)
        # at the ends of the interval the same test has the p-value of the tails
        for end, tail in ((ratios.lower[i], 0.025), (ratios.upper[i], 0.975)):
            u, v = new[:, i] / end + old[:, i], new[:, i] / end - old[:, i]
            r = u @ v / np.sqrt(u @ u * (v @ v))
            assert stats.t.sf(r * np.sqrt(29 / (1 - r**2)), 29) == pytest.approx(tail, rel=1e-6)


@pytest.mark.parametrize("correlation", [0.0, 0.9])
def test_paired_ratio_holds_its_level_in_every_pool(correlation):
    covariance = some_covariance()
    rng = np.random.default_rng(3)
    below, trials = np.zeros(len(LOOKS)), 3000
    for _ in range(trials):
        old = normal_errors(rng, covariance)
        new = correlation * old + np.sqrt(1 - correlation**2) * normal_errors(rng, covariance)
        below += regression.paired_ratio(old, new, covariance).p_better < 0.05
    assert (stats.binom.cdf(below, trials, 0.05) > 1e-4).all()
    assert (stats.binom.sf(below - 1, trials, 0.05) > 1e-4).all()


def test_added_loss_is_the_mean_square_of_the_change():
    covariance = some_covariance()
    rng = np.random.default_rng(4)
    old = normal_errors(rng, covariance)
    std = np.sqrt(np.diag(covariance))
    change = 0.3 * std * rng.standard_normal(old.shape)
    ratios = regression.added_loss(old, old + change, covariance)
    excess = np.square(change / std).mean(axis=0)
    np.testing.assert_allclose(ratios.ratio[:COUNT] ** 2, 1 + excess, rtol=1e-9)
    assert ratios.ratio[-1] ** 2 == pytest.approx(1 + excess.mean())
    assert ((ratios.lower < ratios.ratio) & (ratios.ratio < ratios.upper)).all()


def test_added_loss_of_one_run_is_known_badly_and_of_all_well():
    covariance, old = np.eye(COUNT), np.zeros((128, COUNT))
    one, each = old.copy(), old.copy()
    one[0], each[:, :] = np.sqrt(128) * 0.4, 0.4  # the same mean square
    rare, steady = (regression.added_loss(old, new, covariance) for new in (one, each))
    np.testing.assert_allclose(rare.ratio, steady.ratio)
    assert (rare.p_worse > 1e-3).all()
    assert (steady.p_worse < 1e-20).all()
    assert (rare.upper > steady.upper).all()


def test_added_loss_agrees_with_what_optimal_estimates_lose():
    # x is seen in two ways of equal noise; the old estimate weighs them rightly, the new does not
    rng = np.random.default_rng(5)
    seen = rng.standard_normal((2, 200_000, COUNT))
    old, new = seen.mean(axis=0), 0.7 * seen[0] + 0.3 * seen[1]
    truth = np.sqrt((0.7**2 + 0.3**2) / 0.5)
    ratios = regression.added_loss(old, new, 0.5 * np.eye(COUNT))
    np.testing.assert_allclose(ratios.ratio, truth, rtol=3e-3)
    np.testing.assert_allclose(regression.paired_ratio(old, new, np.eye(COUNT)).ratio, truth, 0.01)


def test_looks_are_the_parameters_and_the_pools_of_them():
    assert list(LOOKS)[:COUNT] == list(NAMES)
    assert len(LOOKS) == 38
    assert [NAMES[i] for i in LOOKS["gyro_scale_factor"]] == ["gyro_k11", "gyro_k22", "gyro_k33"]
    assert {len(LOOKS[look]) for look in ("all", "accel_k", "accel_installation")} == {27, 9, 6}


def test_levels_are_those_that_the_manual_tells():
    assert (regression.TOLERANCE, regression.CONFIDENCE) == (0.02, 0.95)
    assert (regression.COMPARISON_LEVEL, campaign_checks.CHECK_LEVEL) == (2e-4, 5e-5)


def test_data_are_the_same_up_to_a_thousandth_of_their_noise():
    covariance = some_covariance()
    old = consistent(np.random.default_rng(6), covariance)
    for shift, same in ((0.0, True), (0.0009, True), (-0.0009, True), (0.0011, False)):
        sketch = old.sketch.copy()
        sketch[17] += shift
        judgement = regression.judge(old, replace(old, sketch=sketch), np.full(COUNT, np.inf))
        assert judgement.same_data == same
        assert judgement.verdict == ("identical" if same else "changed, no worse")


def test_bounds_that_are_seldom_met_allow_what_their_sigma_does():
    """A violation is not believed to be rarer than one of 10 000, whatever the sigma."""
    error = np.zeros((128, COUNT))
    (check, *_) = campaign_checks.bounds(error, np.eye(COUNT), np.full(COUNT, 100.0))
    assert check.upper == stats.binom.isf(5e-5 / COUNT, 128, 1e-4)


def consistent(rng, covariance):
    error = normal_errors(rng, covariance)
    nees = np.square(np.linalg.solve(np.linalg.cholesky(covariance), error.T)).sum(axis=0)
    return Sample(error, covariance, nees, np.zeros(len(error)))


def failed_checks(sample):
    return [check.name for check in campaign_checks.consistency(sample) if not check.passed]


def test_each_check_finds_what_it_is_for():
    covariance = some_covariance()
    sample = consistent(np.random.default_rng(6), covariance)
    assert failed_checks(sample) == []
    assert failed_checks(replace(sample, nees=1.15 * sample.nees)) == ["mean NEES"]
    assert failed_checks(replace(sample, nees=0.85 * sample.nees)) == ["mean NEES"]
    shift = 0.3 * np.linalg.cholesky(covariance).sum(axis=1)
    assert failed_checks(replace(sample, error=sample.error + shift)) == ["mean error"]
    repeated = sample.error.copy()
    repeated[100] = -repeated[3]
    assert failed_checks(replace(sample, error=repeated)) == ["likeness of two runs"]


def test_checks_hold_their_level(monkeypatch):
    monkeypatch.setattr(campaign_checks, "CHECK_LEVEL", 0.05)
    covariance = some_covariance()
    rng = np.random.default_rng(7)
    failed = [failed_checks(consistent(rng, covariance)) for _ in range(2000)]
    for name in (
        "mean NEES",
        "log of generalised variance over the claimed one",
        "mean error",
        "likeness of two runs",
    ):
        hits = sum(name in names for names in failed)
        assert 1e-4 < stats.binom.cdf(hits, 2000, 0.05) < 1 - 1e-4, name


def test_bounds_count_runs_outside_and_let_the_expected_be():
    covariance = np.eye(COUNT)
    bound = np.full(COUNT, 30.0)
    bound[0] = 2.5
    error = np.zeros((128, COUNT))
    error[:7, 0], error[:3, 1], error[:2, 2] = 2.6, -31.0, 31.0
    checks = campaign_checks.bounds(error, covariance, bound)
    assert [check.value for check in checks[:4]] == [7, 3, 2, 0]
    # 1.6 of 128 runs are expected outside 2.5 sigma; outside 30 sigma, none
    assert [check.passed for check in checks] == [True, False] + [True] * 25
    assert checks[0].upper == stats.binom.isf(5e-5 / 27, 128, 2 * stats.norm.sf(2.5))
    near = np.linspace(0.5, 3.0, COUNT)
    upper = [check.upper for check in campaign_checks.bounds(error, covariance, near)]
    assert upper == stats.binom.isf(5e-5 / 27, 128, 2 * stats.norm.sf(near)).tolist()
    assert upper != stats.binom.isf(7.5e-5 / 27, 128, 2 * stats.norm.sf(near)).tolist()


def test_what_is_not_modelled_is_not_asked():
    """A filter of fewer parameters is judged as if there were no others."""
    covariance = some_covariance()
    rng = np.random.default_rng(8)
    old, new = normal_errors(rng, covariance), normal_errors(rng, covariance)
    own = np.flatnonzero([not name.startswith("lever_arm") for name in NAMES])
    fewer = np.zeros_like(covariance)
    fewer[np.ix_(own, own)] = covariance[np.ix_(own, own)]
    for measure in (regression.paired_ratio, regression.added_loss):
        full, part = measure(old, new, covariance), measure(old, new, fewer)
        assert [*part.names] == [n for n in full.names if n not in lever_arms()]
        untouched = [full.names.index(n) for n in part.names if n != "all"]
        np.testing.assert_allclose(full.p_worse[untouched], part.p_worse[:-1])
        assert full.ratio[-1] != part.ratio[-1]
    sample = Sample(new, fewer, consistent(rng, covariance).nees, np.zeros(len(new)))
    assert sample.columns.tolist() == own.tolist()
    assert not any("lever_arm" in check.name for check in campaign_checks.consistency(sample))
    assert len(campaign_checks.bounds(new, fewer, np.ones(COUNT))) == len(own)


def lever_arms():
    return {"lever_arm", "lever_arm_x", "lever_arm_y", "lever_arm_z"}


@pytest.mark.parametrize("factor", [0.7, 1.4])
def test_a_sigma_that_is_not_honest_is_named(factor):
    covariance = some_covariance()
    sample = consistent(np.random.default_rng(6), covariance)
    scale = np.ones(COUNT)
    scale[5] = factor
    wrong = replace(sample, covariance=covariance * np.outer(scale, scale))
    assert failed_checks(wrong) == [f"RMSE over claimed sigma of {NAMES[5]}"]


def test_sigmas_are_held_to_exact_chi_square():
    sample = consistent(np.random.default_rng(6), some_covariance())
    check = campaign_checks.consistency(sample)[-1]
    tail = campaign_checks.CHECK_LEVEL / (2 * COUNT)
    assert 128 * check.lower**2 == pytest.approx(stats.chi2.ppf(tail, 128))
    assert 128 * check.upper**2 == pytest.approx(stats.chi2.isf(tail, 128))
    sigma = np.sqrt(sample.covariance[-1, -1])
    assert check.value == pytest.approx(np.sqrt(np.mean(sample.error[:, -1] ** 2)) / sigma)


def test_likeness_is_held_to_all_pairs():
    """The limit is the cosine that one of all pairs of random directions has with the level."""
    (check,) = [
        check
        for check in campaign_checks.consistency(
            consistent(np.random.default_rng(6), np.eye(COUNT))
        )
        if check.name == "likeness of two runs"
    ]
    tail = campaign_checks.CHECK_LEVEL / (128 * 127 / 2)
    assert stats.beta.sf(check.upper**2, 0.5, (COUNT - 1) / 2) == pytest.approx(tail, rel=1e-6)


def test_correlations_that_are_not_there_are_found():
    covariance = some_covariance()
    sample = consistent(np.random.default_rng(6), covariance)
    alone = replace(sample, covariance=np.diag(np.diag(covariance)))
    assert "log of generalised variance over the claimed one" in failed_checks(alone)


def claims_failed(old, new, **options):
    return [check.name for check in regression.claims(old, new, **options) if not check.passed]


def test_claims_are_held_to_the_baselines():
    covariance = some_covariance()
    rng = np.random.default_rng(11)
    old = consistent(rng, covariance)

    def claimed(factor):
        scale = np.ones(COUNT)
        scale[3] = factor
        return replace(old, covariance=covariance * np.outer(scale, scale))

    grown = f"claimed sigma of {NAMES[3]} over the baseline's"
    honest = f"RMSE over claimed sigma of {NAMES[3]}, times"
    assert claims_failed(old, old) == []
    assert claims_failed(old, claimed(1.01)) == claims_failed(old, claimed(0.99)) == []
    assert claims_failed(old, claimed(1.03)) == [grown, honest]
    assert claims_failed(old, claimed(0.97)) == [honest]
    # errors that grow with their sigma are honest, and worse
    scaled = claimed(1.2)
    error = old.error.copy()
    error[:, 3] *= 1.2
    assert claims_failed(old, replace(scaled, error=error)) == [grown]
    # other data: an honest sigma passes, whatever the scatter of both campaigns
    assert claims_failed(old, consistent(rng, covariance)) == []
    # a baseline that is not consistent says nothing
    dishonest = replace(old, nees=2 * old.nees)
    assert claims_failed(dishonest, claimed(2.0)) == []


def test_claims_have_the_level_of_all_of_them():
    """At the limit the test of Pitman and Morgan has the level, of both sides of every one."""
    covariance = some_covariance()
    rng = np.random.default_rng(13)
    old, new = consistent(rng, covariance), consistent(rng, covariance)
    for place, check in enumerate(regression.claims(old, new)[1::2]):
        sigma = np.sqrt(covariance[place, place])
        a, b = new.error[:, place] / sigma, old.error[:, place] / sigma
        measured = np.sqrt(a @ a / (b @ b))
        # the scatter that the data give, with a ratio that would be just at the limit
        limit = check.upper / (1 + regression.TOLERANCE)
        a = a / check.value * limit
        r = (a + b) @ (a - b) / np.sqrt((a + b) @ (a + b) * ((a - b) @ (a - b)))
        p = stats.t.sf(r * np.sqrt(127 / (1 - r**2)), 127)
        assert p == pytest.approx(campaign_checks.CHECK_LEVEL / (2 * COUNT), rel=1e-3)
        assert check.lower == pytest.approx(1 / check.upper)
        assert check.value == pytest.approx(measured)


def test_a_share_of_the_level_makes_limits_wider():
    covariance = some_covariance()
    rng = np.random.default_rng(12)
    old, new = consistent(rng, covariance), consistent(rng, covariance)
    sigma = np.sqrt(np.diag(covariance))
    for checks in (
        lambda share: campaign_checks.consistency(new, share),
        lambda share: regression.claims(old, new, share)[1::2],
        lambda share: campaign_checks.bounds(new.error, covariance, 2.5 * sigma, share),
    ):
        for whole, part in zip(checks(1.0), checks(1e-3), strict=True):
            assert part.lower <= whole.lower
            assert part.upper > whole.upper
