"""Innovation statistics of repeated runs, against the runs' own courses."""

import numpy as np
import pytest
from conftest import paper_schedule, paper_truth
from repeated_samples import tolerance
from scipy import stats

from inscal import parameters
from inscal.estimator import Belief
from inscal.experiment import prepare, run_with_history
from inscal.innovations import (
    autocorrelation,
    innovation_statistics,
    share_beyond_band,
    units_told,
    white_band,
    whiten,
)
from inscal.motion import Site
from inscal.recursion import InitialStd
from inscal.simulation import Truth, TruthModel
from inscal.state_model import NoiseModel

NOISE = NoiseModel(1.5e-7, 5e-5, 1e-3, 0.1)
SIZE = paper_truth() * parameters.si_units(1673.84e-9)
STD = InitialStd(np.deg2rad([0.1, 0.1, 0.5]), 0.01, 1.0, SIZE)
RUNS = [5, 0, *range(40, 75)]  # more than there are lanes
STRETCHES, LAGS = (slice(0, 90), slice(30, 120)), (1, 4)


@pytest.fixture(scope="module")
def experiment():
    return prepare(
        8,
        paper_schedule(3, position_duration=40.0),
        Site(np.deg2rad(-35.0), 700.0),
        Truth(TruthModel("normal", SIZE), NOISE, STD),
        Belief(NOISE, STD, passes=2, update_interval=1.0),
        dwell_step=1.0,
        turn_step=0.5,
    )


@pytest.fixture(scope="module")
def taken(experiment):
    return innovation_statistics(experiment, RUNS, STRETCHES, LAGS)


@pytest.mark.parametrize("place", [0, 1, 33, 36])
def test_statistics_are_those_of_the_runs_courses(experiment, taken, place):
    outcome, history = run_with_history(experiment, RUNS[place])
    assert (taken.truth[place] == outcome.truth[0]).all()
    assert (taken.estimate[place] == outcome.estimate[0]).all()
    assert (taken.first_estimate[place] == history.estimate[0, -1, :, 0]).all()
    for number in range(2):
        covariance = experiment.estimator.gains(number).innovation_covariance
        innovation = history.innovation[number, :, :, 0]
        nis = [v @ np.linalg.solve(s, v) for v, s in zip(innovation, covariance, strict=True)]
        np.testing.assert_allclose(taken.nis[number, :, place], nis, rtol=1e-8)
        unit = np.array(
            [
                np.linalg.solve(np.linalg.cholesky(s), v)
                for v, s in zip(innovation, covariance, strict=True)
            ]
        )
        for row, stretch in enumerate(STRETCHES):
            for column, lag in enumerate(LAGS):
                early, late = unit[stretch][:-lag], unit[stretch][lag:]
                power = (early**2).sum(axis=0) * (late**2).sum(axis=0)
                expected = (early * late).sum(axis=0) / np.sqrt(power)
                found = taken.autocorrelation[number, row, column, :, place]
                np.testing.assert_allclose(found, expected, rtol=1e-8)


def test_a_later_pass_lacks_what_the_first_has_learnt(experiment, taken):
    first = experiment.estimator.first
    prior = np.concatenate([STD.parameter, STD.attitude])
    left = np.linalg.eigvalsh(first.covariance / np.outer(prior, prior))  # of a unit, by direction
    told = [units_told(experiment.estimator, number) for number in range(3)]
    np.testing.assert_allclose(told, [0.0, (1.0 - left).sum(), (1.0 - left).sum()], rtol=1e-9)
    lack = taken.nis[0].sum(axis=0) - taken.nis[1].sum(axis=0)  # of the same records
    assert abs(lack.mean() - told[1]) < 4.0 * lack.std() / np.sqrt(len(RUNS))


def test_whitened_innovations_have_unit_covariance():
    rng = np.random.default_rng(2)
    root = np.tril(rng.standard_normal((4, 6, 6))) + 3 * np.eye(6)
    unit = rng.standard_normal((4, 6, 5))
    root *= np.sign(np.diagonal(root, axis1=1, axis2=2))[:, None, :]
    np.testing.assert_allclose(whiten(root @ unit, root @ root.mT), unit, rtol=1e-9)


def test_share_beyond_the_band_is_counted_lag_by_lag():
    updates, lags = 100, (1, 64)
    limits = [stats.norm.ppf(0.975) / np.sqrt(updates - lag) for lag in lags]
    # inside, outside either way at each lag; the second band is wider
    correlation = np.array(
        [
            [[0.99 * limits[0], -1.01 * limits[0]], [0.5 * limits[1], 0.0]],
            [[0.99 * limits[1], 1.01 * limits[0]], [-1.01 * limits[1], 1.01 * limits[1]]],
        ]
    )
    share = share_beyond_band(correlation, updates, lags)
    assert 0.5 * limits[1] < limits[0] < 1.01 * limits[0] < limits[1]
    outside = 1 + 2  # at the first lag and at the second
    assert share.value == outside / 8
    exact = stats.binomtest(outside, 8).proportion_ci(0.99)
    np.testing.assert_allclose([share.lower, share.upper], [exact.low, exact.high])
    assert share_beyond_band(correlation, updates, lags, band=0.999).value == 0.0


def test_autocorrelation_of_an_alternating_and_of_a_constant_sequence():
    sequence = np.column_stack([(-1.0) ** np.arange(10), np.full(10, 3.0)])
    expected = [[-1.0, 1.0], [1.0, 1.0], [-1.0, 1.0]]
    np.testing.assert_allclose(autocorrelation(sequence, [1, 2, 3]), expected)
    for lag in (0, 10):
        with pytest.raises(ValueError, match="lag"):
            autocorrelation(sequence, [lag])


def test_autocorrelation_finds_the_coloured_sequence():
    rng = np.random.default_rng(8)
    white = rng.standard_normal((4000, 400))
    moving = white[1:] + 0.5 * white[:-1]
    band = white_band(4000)
    assert band == pytest.approx(1.96 / np.sqrt(4000), rel=1e-4)
    inside = np.abs(autocorrelation(white, [1, 5, 20])) < band
    assert inside.mean() == pytest.approx(0.95, abs=tolerance(0.95, inside.size))
    # A moving average of order one has autocorrelation 0.5 / 1.25 at lag 1 and none beyond.
    rho = autocorrelation(moving, [1, 2])
    assert rho.mean(axis=1) == pytest.approx([0.4, 0.0], abs=0.005)
