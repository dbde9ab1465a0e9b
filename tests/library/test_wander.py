"""Biases that wander: their Allan deviation, covariances, and steps of any length."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

from inscal.disturbance import Disturbance, stream
from inscal.kernel import LANES
from inscal.wander import Term, add_process, allan_variance, discrete, flicker, terms_of

WANDER = Disturbance(gyro_wander=2.0, gyro_wander_time=7.0)
WALK = Disturbance(accel_random_walk=0.3)


def integrals(disturbance, source, duration, tiles=64, seed=3):
    """Integrals of the bias over steps, (steps, 3 axes of all runs); taken off, so reversed."""
    first = 3 if source.startswith("accel") else 0
    out = []
    for tile in range(tiles):
        made = np.zeros((len(duration), 6, LANES))
        runs = range(tile * LANES, (tile + 1) * LANES)
        add_process(made, disturbance, source, np.asarray(duration), seed=seed, runs=runs)
        assert not np.delete(made, slice(first, first + 3), axis=1).any()
        out.append(-made[:, first : first + 3].reshape(len(duration), -1))
    return np.concatenate(out, axis=1)


def test_flicker_is_flat_from_10_s_to_10_000_s():
    times = np.geomspace(10.0, 10_000.0, 400)
    deviation = np.sqrt(allan_variance(flicker(0.7), times))
    assert np.abs(deviation / 0.7 - 1.0).max() < 0.10


@pytest.mark.parametrize("term", [Term(0.5, 30.0), Term(0.5, np.inf)])
def test_allan_variance_is_that_of_the_spectrum(term):
    """IEEE Std 952: 4 int S(f) sin^4(pi f T) / (pi f T)^2 df."""
    corner = 0.0 if np.isinf(term.time) else 1.0 / (2.0 * np.pi * term.time)

    def density(f):
        return term.density / (2.0 * np.pi) ** 2 / (f**2 + corner**2)

    for averaging in (3.0, 30.0, 300.0):

        def integrand(u, averaging=averaging):
            return density(u / (np.pi * averaging)) * np.sin(u) ** 4 / u**2

        ends = np.pi * np.arange(0, 400)
        total = sum(quad(integrand, a + 1e-12, b)[0] for a, b in pairwise(ends))
        expected = 4.0 * total / (np.pi * averaging)
        found = allan_variance([term], np.array([averaging]))[0]
        assert found == pytest.approx(expected, rel=1e-3)


def test_made_flicker_has_that_allan_variance():
    about = Disturbance(gyro_flicker=1.0)
    made = integrals(about, "gyro_flicker", np.full(1200, 10.0), tiles=4)
    for count in (1, 10, 100):
        mean = made.reshape(-1, count, made.shape[1]).mean(axis=1) / 10.0
        found = 0.5 * np.square(np.diff(mean, axis=0)).mean()
        expected = allan_variance(flicker(1.0), np.array([10.0 * count]))[0]
        assert found == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("step", [1e-3, 0.1, 1.0, 40.0])
def test_a_step_is_exact_against_a_fine_one(step):
    """Mean and covariance of state and integral after many small steps, or one."""
    for term in (Term(2.0 * 2.0**2 / 7.0, 7.0), Term(0.09, np.inf)):
        moments = []
        for pieces in (1, 50):
            phi, gain, u, iu, iv = discrete(term, np.full(1, step / pieces))[0]
            a = np.array([[phi, 0.0], [gain, 1.0]])  # of state and integral so far
            q = np.array([[u * u, u * iu], [u * iu, iu * iu + iv * iv]])
            mean, covariance = np.eye(2), np.zeros((2, 2))
            for _ in range(pieces):
                mean, covariance = a @ mean, a @ covariance @ a.T + q
            moments.append(np.concatenate([mean[:, 0], covariance.ravel()]))
        np.testing.assert_allclose(moments[0], moments[1], rtol=2e-8, atol=1e-14)


def test_a_stationary_bias_has_the_variance_and_correlation_of_its_size_and_time():
    duration = np.array([0.5, 3.0, 0.01, 6.0])
    made = integrals(WANDER, "gyro_wander", duration)
    edges = np.concatenate([[0.0], np.cumsum(duration)])

    def covariance(a, b, c, d):
        inner = lambda t: quad(lambda s: np.exp(-abs(t - s) / 7.0), c, d)[0]  # noqa: E731
        return 4.0 * quad(inner, a, b)[0]

    found = made @ made.T / made.shape[1]
    for i in range(4):
        for j in range(i, 4):
            expected = covariance(edges[i], edges[i + 1], edges[j], edges[j + 1])
            scale = np.sqrt(found[i, i] * found[j, j])
            assert abs(found[i, j] - expected) < 5 * np.sqrt(2.0 / made.shape[1]) * scale


def test_a_random_walk_grows_with_time():
    made = integrals(WALK, "accel_random_walk", np.array([5.0, 15.0]))
    total = made.sum(axis=0)
    expected = 0.3**2 * 20.0**3 / 3.0  # of its integral over 20 s
    assert np.square(total).mean() == pytest.approx(expected, rel=5 * np.sqrt(2 / total.size))


def test_streams_are_those_of_source_and_run():
    about = Disturbance(
        gyro_wander=1.0, gyro_wander_time=5.0, accel_wander=1.0, accel_wander_time=5.0
    )
    steps = np.full(6, 1.0)
    gyro = integrals(about, "gyro_wander", steps, tiles=1)
    accel = integrals(about, "accel_wander", steps, tiles=1)
    assert abs(np.corrcoef(gyro.ravel(), accel.ravel())[0, 1]) < 0.3
    alone = np.zeros((6, 6, LANES))
    add_process(alone, about, "gyro_wander", steps, seed=3, runs=[7] * LANES)
    np.testing.assert_array_equal(-alone[:, :3, 0], gyro.reshape(6, 3, LANES)[:, :, 7])
    np.testing.assert_array_equal(alone[:, :, 0], alone[:, :, LANES - 1])
    draws = {
        tuple(stream(s, r, x).standard_normal(2))
        for s in (1, 2)
        for r in (0, 256)
        for x in ("gyro_wander", "accel_wander", "table_offset")
    }
    assert len(draws) == 12


def test_terms_say_what_the_sizes_are():
    (wander,) = terms_of(WANDER, "gyro_wander")
    assert (wander.initial_std, wander.time) == (pytest.approx(2.0), 7.0)
    (walk,) = terms_of(WALK, "accel_random_walk")
    assert (walk.initial_std, walk.density) == (0.0, pytest.approx(0.09))
