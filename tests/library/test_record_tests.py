"""Tests of a record without truth: their distributions, and what they do see of a disturbance."""

from functools import cache

import numpy as np
import pytest
from disturbed_case import (
    NOISE,
    SCHEDULE,
    SITE,
    SIZES,
    STD,
    TIMES,
    disturbed_by,
    every_system,
    plain,
)
from scipy import stats

from inscal.budget import budget
from inscal.calibrator import empty_history
from inscal.disturbance import draw_constants
from inscal.estimator import Belief
from inscal.experiment import tiles
from inscal.innovations import whiten
from inscal.path import path_of
from inscal.record_tests import (
    difference_covariance,
    likeness,
    positions,
    scores,
    smallest,
    smallest_wander,
    traces_of,
    whiteness,
)
from inscal.response import response
from inscal.state_model import StateModel, build_transitions
from inscal.suspects import CONSTANT, COSINES, Span, suspects, wander_covariance

RUNS = 64
BELIEF = Belief(NOISE, STD, passes=2, update_interval=1.0)


@cache
def path():
    return path_of(SCHEDULE, SITE, update_interval=1.0, dwell_step=1.0, turn_step=0.1)


@cache
def traces(number=1):
    transitions = build_transitions(SCHEDULE, SITE, StateModel(), NOISE, update_interval=1.0)
    made = response(path(), 1.0)
    every = suspects(path(), made, StateModel())
    return traces_of(plain().estimator, number, transitions, BELIEF, every)


def innovations_of(experiment, runs=RUNS):
    """Whitened, of the second pass; shape (updates, 6, runs)."""
    history = empty_history(2, experiment.motion.updates, estimates=False)
    out = []
    for _, truth, _ in tiles(experiment, range(runs), history=history):
        kept = history.innovation[1, :, :, : len(truth)]
        out.append(whiten(kept, experiment.estimator.gains(1).innovation_covariance))
    return np.concatenate(out, axis=2)


@cache
def undisturbed():
    return innovations_of(plain())


def test_scores_of_a_right_filter_are_chi_square():
    for name, total in scores(traces(), undisturbed()).items():
        dof = traces().suspects[name].dof
        if dof:
            p = stats.chi2.sf(total, dof)
            assert stats.kstest(p, "uniform").pvalue > 1e-4, name


def test_positions_of_a_right_filter_are_chi_square():
    spans = [slice(60 * n, 60 * n + 55) for n in range(25)]
    seen = np.ones(undisturbed().shape[:2], dtype=bool)
    total, dof = positions(traces(), undisturbed(), seen, spans)
    assert (dof < 330.0).all()
    assert stats.kstest(stats.chi2.cdf(total, dof[:, None]).ravel(), "uniform").pvalue > 1e-4
    whole, count = positions(traces(), undisturbed(), seen, [slice(0, len(seen))])
    assert count[0] == pytest.approx(seen.size - 30.0)  # 27 parameters, three of attitude
    assert whole.mean() == pytest.approx(count[0], rel=4.0 * np.sqrt(2.0 / (count[0] * RUNS)))


def test_what_is_not_observed_is_not_counted():
    seen = np.ones(undisturbed().shape[:2], dtype=bool)
    seen[10:20, 3:] = False
    _, dof = positions(traces(), undisturbed(), seen, [slice(0, 30)])
    _, whole = positions(traces(), undisturbed(), np.ones_like(seen), [slice(0, 30)])
    assert whole[0] - dof[0] == 30.0


@pytest.mark.parametrize("source", ["gyro_accel_delay", "accel_cubic", "off_axis_lever_arm"])
def test_a_disturbance_adds_what_its_trace_says(source):
    """Mean of the score of whole nonlinear runs, against that of a noncentral chi-square."""
    size = 20.0 * SIZES[source]
    experiment = disturbed_by(**{source: size})
    total = scores(traces(), innovations_of(experiment))[source]
    drawn = draw_constants(
        experiment.truth.disturbance, source, len(SCHEDULE.turns), seed=9, runs=range(RUNS)
    )
    trace = traces().suspects[source]
    added = np.square(trace.size @ drawn).sum(axis=0)
    assert added.mean() > 5.0
    spread = np.sqrt(2.0 * trace.dof + 4.0 * added)
    z = (total - trace.dof - added) / spread
    assert abs(z.mean()) * np.sqrt(RUNS) < 4.0
    assert 0.7 < z.std() < 1.3


@pytest.mark.parametrize("number", [0, 1])
def test_constants_move_estimates_as_in_the_budget(number):
    made = budget(every_system()).effects
    sigma = plain().estimator.predicted_std[:, None]
    for name in CONSTANT:
        moved = traces(number).suspects[name].moved[:27]
        np.testing.assert_allclose(
            moved / sigma,
            made[name] / sigma,
            rtol=1e-5,
            atol=1e-6 * np.abs(made[name] / sigma).max(),
        )


def test_gravity_and_what_parameters_do_leaves_nothing_to_test():
    assert traces().suspects["gravity"].dof == 0
    assert scores(traces(), undisturbed())["gravity"].max() == 0.0
    assert np.isinf(smallest(traces().suspects["gravity"], 0.01, 0.95)).all()


def test_the_smallest_size_is_found_as_often_as_said():
    trace = traces().suspects["off_axis_lever_arm"]
    size = smallest(trace, 0.01, 0.9)
    for place in range(2):
        noncentral = np.square(trace.size[:, place] * size[place]).sum()
        found = stats.ncx2.sf(stats.chi2.isf(0.01, trace.dof), trace.dof, noncentral)
        assert found == pytest.approx(0.9, abs=1e-6)


def test_the_smallest_wander_is_found_as_often_as_said():
    trace = traces().suspects["accel_wander"]
    variance = wander_covariance(1.0, TIMES["accel_wander_time"], 1500.0)
    size = smallest_wander(trace, variance, 0.01, 0.9)
    rng = np.random.default_rng(3)
    drawn = size * np.sqrt(variance)[:, None] * rng.standard_normal((len(variance), 20000))
    score = trace.size @ drawn + rng.standard_normal((trace.dof, 20000))
    found = (np.square(score).sum(axis=0) > stats.chi2.isf(0.01, trace.dof)).mean()
    assert found == pytest.approx(0.9, abs=0.03)  # the gamma of its mean and variance


def test_cosines_hold_a_wander():
    """Variance of the coefficients of drawn Gauss-Markov biases, each sampled each second."""
    time, duration, runs = 100.0, 2000, 4000
    rng = np.random.default_rng(5)
    kept = np.exp(-1.0 / time)
    x = np.empty((duration, runs))
    x[0] = rng.standard_normal(runs)
    for k in range(1, duration):
        x[k] = kept * x[k - 1] + np.sqrt(1.0 - kept**2) * rng.standard_normal(runs)
    waves = np.cos(
        np.pi * np.outer(np.arange(1, COSINES + 1), np.arange(duration) + 0.5) / duration
    )
    found = (2.0 / duration * waves @ x).var(axis=1)
    expected = wander_covariance(1.0, time, float(duration))[::3]
    np.testing.assert_allclose(found, expected, rtol=0.15)


def test_a_part_has_the_shapes_of_the_whole():
    """Both halves of a span, one after the other, are the span."""
    made = response(path(), 1.0)
    whole = dict(suspects(path(), made, StateModel()))
    same = dict(suspects(path(), made, StateModel(), Span(0.0, 1500.0)))
    later = dict(suspects(path(), made, StateModel(), Span(1500.0, 3000.0)))
    for name in ("accel_wander", "gyro_bias_x_drift"):
        np.testing.assert_allclose(whole[name].navigation, same[name].navigation, atol=1e-9)
    # a drift of the second half runs from nothing in the middle to half a unit at the end
    first, last = later["accel_bias_x_drift"].navigation[[0, -1], 3:6, 0]
    assert np.linalg.norm(first) < 1e-3 * np.linalg.norm(last)


def test_whiteness_tells_white_from_red():
    rng = np.random.default_rng(7)
    white = rng.standard_normal((2000, 6))
    red = white + 0.5 * np.roll(white, 1, axis=0)
    seen = np.ones(white.shape, dtype=bool)
    p = stats.chi2.sf(whiteness(white, seen, 20), 20)
    assert len(p) == 6
    assert p.min() > 1e-4
    assert stats.chi2.sf(whiteness(red, seen, 20), 20).max() < 1e-6
    seen[100:, 3:] = False
    assert len(whiteness(white, seen, 20)) == 3  # the others are too short


def test_the_difference_of_two_estimates_has_the_covariance_said():
    """Posteriors of one drawn truth from two sets of data, drawn often."""
    rng = np.random.default_rng(11)
    prior, runs = np.array([1.0, 0.5, 2.0]), 40000
    truth = prior[:, None] * rng.standard_normal((3, runs))
    estimates, covariances = [], []
    for _ in range(2):
        h = rng.standard_normal((4, 3))
        p = np.linalg.inv(h.T @ h + np.diag(prior**-2))
        estimates.append(p @ h.T @ (h @ truth + rng.standard_normal((4, runs))))
        covariances.append(p)
    expected = difference_covariance(*covariances, prior)
    found = np.cov(estimates[1] - estimates[0])
    sigma = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(
        found / np.outer(sigma, sigma), expected / np.outer(sigma, sigma), atol=0.03
    )
    assert (difference_covariance(*covariances, None) == covariances[0] + covariances[1]).all()


def test_a_suspect_is_the_likelier_the_more_it_looks_like_the_difference():
    """Against the densities of normal vectors, and a size that was drawn."""
    rng = np.random.default_rng(13)
    root = rng.standard_normal((8, 8))
    covariance, moved = root @ root.T, rng.standard_normal((8, 3))
    variance = np.array([1.0, 0.5, 0.2])
    drawn = moved @ (30.0 * np.sqrt(variance) * rng.standard_normal(3))
    difference = drawn + root @ rng.standard_normal(8)
    ratio, size = likeness(difference, covariance, moved, variance)

    def log_density(s):
        spread = covariance + s**2 * (moved * variance) @ moved.T
        return stats.multivariate_normal(np.zeros(8), spread).logpdf(difference)

    assert ratio == pytest.approx(log_density(size) - log_density(0.0), rel=1e-6)
    assert all(log_density(size) >= log_density(factor * size) for factor in (0.9, 1.1))
    assert 8.0 < size < 120.0
    other, _ = likeness(difference, covariance, rng.standard_normal((8, 3)), variance)
    assert other < ratio
    assert likeness(difference, covariance, np.zeros((8, 3)), variance) == (0.0, 0.0)
