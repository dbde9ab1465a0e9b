import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.integrate import quad_vec
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from inscal.rotation import (
    MAX_STEP_ANGLE,
    RAMP_TERMS,
    mean_rotation,
    mean_rotation_of_ramp,
    ramp_terms,
    series,
    skew,
    turn,
)

vectors = arrays(float, 3, elements=st.floats(-1, 1)).filter(lambda v: np.linalg.norm(v) > 1e-3)


@given(vectors, st.floats(1e-6, MAX_STEP_ANGLE))
def test_series_are_exact_to_rounding(direction, angle):
    v = direction / np.linalg.norm(direction) * angle
    a, b, c, d = series(angle**2)
    s = skew(v)
    np.testing.assert_allclose(np.eye(3) + a * s + b * s @ s, expm(s), atol=4e-16)
    mean = np.eye(3) + b * s + c * s @ s
    np.testing.assert_allclose(mean, mean_rotation(v), atol=4e-16)
    np.testing.assert_allclose((np.eye(3) - 0.5 * s + d * s @ s) @ mean, np.eye(3), atol=4e-16)


@given(vectors, vectors)
def test_turn_applies_the_matrix_polynomial(u, v):
    expected = (np.eye(3) + 0.3 * skew(u) - 0.2 * skew(u) @ skew(u)) @ v
    np.testing.assert_allclose(turn(0.3, -0.2, tuple(u), tuple(v)), expected, atol=1e-15)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-3, 0.9, 3.0, 6.2])
def test_mean_rotation_is_the_integral_of_rotations(angle):
    v = angle * np.array([2.0, -1.0, 2.0]) / 3.0
    integral, _ = quad_vec(lambda s: Rotation.from_rotvec(s * v).as_matrix(), 0, 1, epsabs=1e-12)
    np.testing.assert_allclose(mean_rotation(v), integral, atol=1e-12)


@pytest.mark.parametrize("ramp", [1.0, -1.0, 0.4, -0.07, 0.0])
@pytest.mark.parametrize("angle", [1e-7, 0.04, 0.25, 1.0])
def test_mean_rotation_of_a_ramp_is_the_integral_over_time(angle, ramp):
    v = angle * np.array([2.0, -1.0, 2.0]) / 3.0

    def at(tau):  # the rate goes linearly from 1 - ramp to 1 + ramp
        return Rotation.from_rotvec(((1 - ramp) * tau + ramp * tau**2) * v).as_matrix()

    integral, _ = quad_vec(at, 0, 1, epsabs=1e-15)
    got = mean_rotation_of_ramp(np.array([v, 0 * v]), np.array([ramp, 0.0]))
    np.testing.assert_allclose(got, [integral, np.eye(3)], atol=2e-15)


@pytest.mark.parametrize("ramp", [1.0, -1.0, 0.4, -0.07])
@pytest.mark.parametrize("angle", [1e-7, 0.04, MAX_STEP_ANGLE])
def test_ramp_terms_are_what_a_ramp_has_beyond_a_steady_turn(angle, ramp):
    v = angle * np.array([2.0, -1.0, 2.0]) / 3.0
    s = skew(v)
    [terms] = ramp_terms(np.array([ramp]))
    x = angle**2
    p, q = np.polyval(terms[4:0:-1], x), np.polyval(terms[8:4:-1], x)
    bent = mean_rotation_of_ramp(-v[None], np.array([ramp]))[0]
    steady = mean_rotation(-v)
    np.testing.assert_allclose(
        np.eye(3) + p * s + q * s @ s, steady @ np.linalg.inv(bent), atol=1e-12
    )
    a, b = np.polyval(terms[11:8:-1], x), np.polyval(terms[14:11:-1], x)
    np.testing.assert_allclose(a * s + b * s @ s, steady - bent, atol=1e-9 * angle + 1e-15)
    assert terms[0] == ramp
    assert terms[1] == pytest.approx(-ramp / 6, rel=1e-14)


def test_no_ramp_has_no_terms():
    assert (ramp_terms(np.array([0.0, 0.5, 0.0]))[::2] == np.zeros((2, RAMP_TERMS))).all()


@pytest.mark.parametrize("ramp", [1.0, -0.6])
def test_moments_of_a_ramp(ramp):
    tau = (np.arange(100_000) + 0.5) / 100_000
    s, w = tau - ramp * tau * (1 - tau), 1 + ramp * (2 * tau - 1)
    assert s.mean() == pytest.approx(0.5 - ramp / 6, rel=1e-8)
    assert s.var() == pytest.approx((1 + ramp**2 / 15) / 12, rel=1e-8)
    assert (w**2).mean() == pytest.approx(1 + ramp**2 / 3, rel=1e-8)
