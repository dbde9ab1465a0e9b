import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from inscal import parameters
from inscal.sensor import compensate, compensate_in_ramp, inverse_matrices, sense, sense_in_ramp

NOTHING = (0.0, 0.0, 0.0)
unit = arrays(float, 27, elements=st.floats(-1, 1))
rates = arrays(float, 3, elements=st.floats(-1, 1))


def scaled(values):
    """Parameters of ten times the paper's size: 5000 ppm, 0.5 deg/h, 2 mg, 0.3 m."""
    index, size = parameters.INDEX, np.full(27, 5e-3)
    size[index["gyro_bias"]], size[index["accel_bias"]] = 2.4e-6, 0.02
    size[index["accel_quadratic"]], size[index["lever_arm"]] = 5e-4, 0.3
    return (values * size)[:, None]


@given(unit, rates, rates, st.sampled_from([0.01, 0.1, 1.0]))
def test_compensation_inverts_the_sensor(values, turned, force, dt):
    p = scaled(values)
    angle, velocity = tuple(0.1 * turned), tuple(20.0 * force * dt)
    reported = sense(p, inverse_matrices(p), 0, angle, velocity, NOTHING, NOTHING, dt)
    back = compensate(p, 0, *reported, dt)
    np.testing.assert_allclose(back[0], angle, atol=1e-15)
    np.testing.assert_allclose(back[1], velocity, atol=5e-13)  # of up to 20 m/s


def test_compensation_against_the_papers_equations():
    rng = np.random.default_rng(5)
    p = scaled(rng.uniform(-1, 1, 27))
    w, f, dt = rng.uniform(-1, 1, 3), rng.uniform(-10, 10, 3), 0.1
    index = parameters.INDEX
    kg, ka = np.zeros((3, 3)), np.zeros((3, 3))
    for name, value in zip(parameters.NAMES, p[:, 0], strict=True):
        if name.startswith("gyro_k"):
            kg[int(name[-2]) - 1, int(name[-1]) - 1] = value
        if name.startswith("accel_k"):
            ka[int(name[-2]) - 1, int(name[-1]) - 1] = value
    rate = (np.eye(3) + kg) @ w + p[index["gyro_bias"], 0]
    quadratic = f + p[index["accel_quadratic"], 0] * f**2
    lever = (rate @ rate - rate**2) * p[index["lever_arm"], 0]
    force = (np.eye(3) + ka) @ quadratic + p[index["accel_bias"], 0] + lever
    # the mean of a square within the step
    force = force + p[index["accel_quadratic"], 0] * np.cross(rate * dt, force) ** 2 / 12
    angle, velocity = compensate(p, 0, tuple(w * dt), tuple(f * dt), dt)
    np.testing.assert_allclose(angle, rate * dt, rtol=1e-14)
    np.testing.assert_allclose(velocity, force * dt, rtol=1e-13)


def test_noise_enters_on_the_right_hand_side():
    p = scaled(np.linspace(-1, 1, 27))
    angle, velocity = (0.01, -0.02, 0.005), (0.3, -0.2, 0.98)
    na, nv = (1e-6, 2e-6, -3e-6), (1e-4, -2e-4, 3e-4)
    reported = sense(p, inverse_matrices(p), 0, angle, velocity, na, nv, 0.1)
    back = compensate(p, 0, *reported, 0.1)
    np.testing.assert_allclose(np.subtract(angle, back[0]), na, rtol=1e-9)
    # the lever arm sees the noisy rate when compensated: w dw r, far below the noise
    np.testing.assert_allclose(np.subtract(velocity, back[1]), nv, atol=2e-6)


def test_lever_arm_takes_away_centripetal_force():
    p = np.zeros((27, 1))
    p[parameters.INDEX["lever_arm"], 0] = [0.1, 0.2, 0.3]
    still = sense(p, inverse_matrices(p), 0, NOTHING, NOTHING, NOTHING, NOTHING, 1.0)
    turning = sense(p, inverse_matrices(p), 0, (0.0, 0.0, 0.5), NOTHING, NOTHING, NOTHING, 1.0)
    assert still[1] == (0.0, 0.0, 0.0)
    # about z the arms on x and y move on circles; their accelerometers feel -w^2 r outwards
    np.testing.assert_allclose(turning[1], [-0.25 * 0.1, -0.25 * 0.2, 0.0], rtol=1e-14)


def test_quadratic_term_without_a_solution_is_nan():
    p = np.zeros((27, 1))
    p[parameters.INDEX["accel_quadratic"], 0] = -0.1
    _, velocity = sense(p, inverse_matrices(p), 0, NOTHING, (9.8,) * 3, NOTHING, NOTHING, 1.0)
    assert np.isnan(velocity).all()


def test_variance_within_a_step_is_that_of_a_turning_force():
    # a sensor at a thousand times the rate, in a turn of 5 deg about a skew axis
    p = np.zeros((27, 1))
    p[parameters.INDEX["accel_quadratic"], 0] = [5e-5, -4e-5, 3e-5]
    turned, force, dt, fine = np.deg2rad([3.0, -2.0, 3.0]), np.array([2.0, -5.0, 8.0]), 0.5, 1000
    whole, reported = np.zeros(3), np.zeros(3)
    for k in range(fine):
        f = Rotation.from_rotvec(-turned * (k + 0.5) / fine).apply(force) * dt / fine
        _, v = sense(
            p, inverse_matrices(p), 0, tuple(turned / fine), tuple(f), NOTHING, NOTHING, dt / fine
        )
        whole, reported = whole + f, reported + v
    _, back = compensate(p, 0, tuple(turned), tuple(reported), dt)
    quadratic = np.abs(whole).max() ** 2 / dt * 5e-5
    # without the spread it would be off by theta^2 / 12, half a per mille
    assert np.abs(back - whole).max() < 5e-6 * quadratic


@pytest.mark.parametrize("rates", [(0.0, 10.0), (10.0, 0.0), (4.0, 9.0), (-3.0, -8.0)])
def test_ramp_is_that_of_many_small_steps(rates):
    """Lever arms and quadratic terms of a sensor at four thousand times the rate, one at a time."""
    dt, fine, force = 0.5, 4000, np.array([2.0, -5.0, 8.0])
    axis = np.array([3.0, -2.0, 3.0]) / np.sqrt(22.0)
    first, last = np.deg2rad(rates)
    ramp = (last - first) / (last + first)

    def angle_at(t):
        return first * t + 0.5 * (last - first) / dt * t**2

    edges = np.linspace(0.0, dt, fine + 1)
    angle, middle = angle_at(edges), angle_at(0.5 * (edges[1:] + edges[:-1]))
    for group, size, tolerance in (
        ("lever_arm", [0.03, -0.02, 0.05], 2e-6),
        ("accel_quadratic", [5e-5, -4e-5, 3e-5], 5e-6),
    ):
        p = np.zeros((27, 1))
        p[parameters.INDEX[group], 0] = size
        whole, reported = np.zeros(3), np.zeros(3)
        for k in range(fine):
            f = Rotation.from_rotvec(-axis * middle[k]).apply(force) * dt / fine
            w = axis * (angle[k + 1] - angle[k])
            _, v = sense(p, inverse_matrices(p), 0, tuple(w), tuple(f), NOTHING, NOTHING, dt / fine)
            whole, reported = whole + f, reported + v
        turned = tuple(axis * angle[-1])
        effect = np.abs(whole - reported).max()
        _, back = compensate_in_ramp(p, 0, turned, tuple(reported), dt, ramp)
        assert np.abs(back - whole).max() < tolerance * effect
        if group == "lever_arm":  # what a steady turn would have needs ramp^2 / 3 more
            _, steady = compensate(p, 0, turned, tuple(reported), dt)
            assert np.abs(steady - whole).max() > 0.02 * effect


@pytest.mark.parametrize("ramp", [1.0, -1.0, 0.3])
def test_compensation_undoes_the_sensor_in_a_ramp(ramp):
    p = np.full((27, 1), 1e-4)
    p[parameters.INDEX["lever_arm"], 0] = [0.03, -0.02, 0.05]
    p[parameters.INDEX["accel_quadratic"], 0] = [5e-5, -4e-5, 3e-5]
    angle, velocity, dt = (0.04, -0.02, 0.03), (1.0, -2.5, 4.0), 0.5
    noise = (1e-6, -2e-6, 3e-6), (1e-4, 2e-4, -1e-4)
    reported = sense_in_ramp(p, inverse_matrices(p), 0, angle, velocity, NOTHING, NOTHING, dt, ramp)
    back = compensate_in_ramp(p, 0, *reported, dt, ramp)
    np.testing.assert_allclose(back, (angle, velocity), rtol=1e-13, atol=1e-15)
    noisy = sense_in_ramp(p, inverse_matrices(p), 0, angle, velocity, *noise, dt, ramp)
    back = compensate_in_ramp(p, 0, *noisy, dt, ramp)
    np.testing.assert_allclose(np.subtract((angle, velocity), back), noise, atol=4e-8)
