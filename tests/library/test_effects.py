"""Effects of single sensor errors on navigation, against what theory expects of them."""

import numpy as np
import pytest

from inscal import earth, effects
from inscal.effects import Environment, north_errors, schuler_rate, true_increments
from inscal.motion import Site
from inscal.parameters import COUNT, NAMES

SITE = Site(np.deg2rad(39.98), 50.0)
QUARTER = 0.5 * np.pi / schuler_rate(SITE)


def case(**values):
    """True parameters of one case, shape (27, 1)."""
    truth = np.zeros((COUNT, 1))
    for name, value in values.items():
        truth[NAMES.index(name)] = value
    return truth


def largest(course):
    return np.abs(course.north).max(axis=0)


def test_constant_error_grows_to_its_schuler_amplitude():
    bias = 1e-3
    course = north_errors(
        Environment(1.0), case(accel_bias_x=bias), SITE, duration=5400.0, interval=10.0
    )
    expected = -bias / schuler_rate(SITE) * np.sin(schuler_rate(SITE) * course.time)
    # the Foucault rotation turns some of it east in an hour and a half
    np.testing.assert_allclose(course.north[:, 0], expected, atol=0.12 * bias / schuler_rate(SITE))
    early = course.time < QUARTER
    np.testing.assert_allclose(course.north[early, 0], expected[early], atol=0.012)
    assert largest(course)[0] == pytest.approx(bias / schuler_rate(SITE), rel=0.02)


def test_quadratic_term_rectifies_vibration():
    rms, quadratic = 8.0, 5e-5
    shaken = Environment(1e-3, frequency=20.0, acceleration=np.sqrt(2.0) * rms)
    course = north_errors(
        shaken, case(accel_quadratic_x=quadratic), SITE, duration=300.0, interval=1.0
    )
    slope = np.polyfit(course.time, course.north[:, 0], 1)[0]
    # within 300 s the Schuler sine falls short of the ramp by a few per cent
    ramp = np.polyfit(course.time, np.sin(schuler_rate(SITE) * course.time), 1)[0]
    expected = -effects.vibration_error(quadratic, rms) / schuler_rate(SITE) * ramp
    assert slope == pytest.approx(expected, rel=0.005)


def test_entries_are_at_every_interval_and_no_step_is_left_out(monkeypatch):
    """Entries of a longer interval are some of those of every step, whatever the pieces."""
    swing = Environment(0.1, frequency=0.2, angle=0.3, axis=1)
    truth = case(accel_bias_x=1e-3, lever_arm_y=0.1)
    full = north_errors(swing, truth, SITE, duration=40.0, interval=0.1)
    assert len(full.time) == 400
    np.testing.assert_allclose(full.time, 0.1 * np.arange(1, 401))
    assert (
        north_errors(swing, truth, SITE, duration=40.0, interval=0.01).north == full.north
    ).all()
    monkeypatch.setattr(effects, "_PIECE", 70)
    fewer = north_errors(swing, truth, SITE, duration=40.0, interval=1.3)
    np.testing.assert_allclose(fewer.time, 1.3 * np.arange(1, 31))
    np.testing.assert_allclose(fewer.north, full.north[12::13][:30], rtol=1e-9, atol=1e-14)


@pytest.mark.parametrize("name", ["lever_arm_x", "accel_quadratic_x"])
def test_rest_makes_nothing_of_level_errors(name):
    course = north_errors(
        Environment(1.0), case(**{name: 1e-4}), SITE, duration=1000.0, interval=10.0
    )
    assert largest(course)[0] < 1e-6


def test_linear_vibration_makes_nothing_of_a_lever_arm():
    shaken = Environment(1e-3, frequency=20.0, acceleration=10.0)
    course = north_errors(shaken, case(lever_arm_x=0.02), SITE, duration=50.0, interval=1.0)
    assert largest(course)[0] < 1e-6


def test_swing_makes_the_mean_centripetal_force_of_a_lever_arm():
    arm, angle, frequency = 0.02, np.deg2rad(60.0), 0.1
    swing = Environment(0.01, frequency=frequency, angle=angle)
    course = north_errors(swing, case(lever_arm_x=arm), SITE, duration=QUARTER, interval=10.0)
    expected = -effects.swing_error(arm, angle, frequency) / schuler_rate(SITE)
    assert course.north[-1, 0] == pytest.approx(expected, rel=0.01)
    # a swing too small to turn the force leaves the mean square rate
    small = 1e-3
    mean_square = 0.5 * (2.0 * np.pi * frequency * small) ** 2
    assert effects.swing_error(arm, small, frequency) == pytest.approx(arm * mean_square, rel=1e-6)


def test_error_scales_with_the_square_of_the_swing_rate():
    def mean_error(frequency):
        return effects.swing_error(0.01, 0.5, frequency)

    assert mean_error(0.2) == pytest.approx(4.0 * mean_error(0.1))


def test_swing_returns_the_body_and_the_vibration_its_velocity():
    swing = Environment(0.01, frequency=0.5, angle=1.0, axis=1)
    angle, _ = true_increments(swing, SITE, 0, 200)
    assert abs(angle[:, 1].sum()) < 1e-3
    assert np.abs(angle[:, 1]).sum() == pytest.approx(4.0, rel=1e-3)
    shaken = Environment(0.001, frequency=10.0, acceleration=5.0)
    _, velocity = true_increments(shaken, SITE, 0, 50)  # half a cycle
    assert velocity[:, 0].sum() == pytest.approx(2.0 * 5.0 / (20.0 * np.pi), rel=1e-4)


def test_pieces_join_without_a_seam(monkeypatch):
    swing = Environment(0.05, frequency=0.1, angle=1.0)
    truth = case(lever_arm_x=0.02)
    whole = north_errors(swing, truth, SITE, duration=100.0, interval=1.0)
    monkeypatch.setattr(effects, "_PIECE", 60)
    np.testing.assert_array_equal(
        north_errors(swing, truth, SITE, duration=100.0, interval=1.0).north, whole.north
    )
    assert whole.time[-1] == pytest.approx(100.0)


def test_schuler_period():
    assert 2.0 * np.pi / schuler_rate(SITE) == pytest.approx(5064.0, rel=0.005)
    assert schuler_rate(SITE) ** 2 * earth.SEMI_MAJOR_AXIS == pytest.approx(9.8, rel=0.01)
