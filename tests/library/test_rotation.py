import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.integrate import quad_vec
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from inscal.rotation import MAX_STEP_ANGLE, mean_rotation, series, skew, turn

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
