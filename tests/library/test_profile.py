import numpy as np
import pytest

from inscal.profile import Profile, profile_of


def test_without_an_acceleration_a_turn_is_at_once():
    assert profile_of(3.0, 0.25, None) == Profile(0.0, 12.0, 0.25)
    assert profile_of(3.0, 0.25, None).duration == 12.0


def test_trapezoid_reaches_the_rate_and_takes_a_ramp_longer():
    profile = profile_of(180.0, 10.0, 20.0)
    assert profile == Profile(0.5, 17.5, 10.0)
    assert profile.duration == 180.0 / 10.0 + 10.0 / 20.0


def test_small_turn_is_a_triangle():
    profile = profile_of(45.0, 60.0, 20.0)  # 60 deg/s would take 180 deg
    assert profile == Profile(1.5, 0.0, 30.0)
    assert profile.duration == 2 * np.sqrt(45.0 / 20.0)


@pytest.mark.parametrize("acceleration", [0.3, 1.0, 2.0, 2.1, 40.0, 1e5])
@pytest.mark.parametrize("angle", [0.7, 2.0, 6.3])
def test_area_under_the_rate_is_the_angle(angle, acceleration):
    profile = profile_of(angle, 2.0, acceleration)
    area = profile.rate * (profile.ramp + profile.steady)
    assert area == pytest.approx(angle, rel=1e-14)
    assert profile.rate <= 2.0
    # no ramp is steeper than the table can do
    assert profile.rate / profile.ramp == pytest.approx(acceleration, rel=1e-14)


def test_trapezoid_and_triangle_meet():
    edge = 2.0**2 / 0.5
    around = [profile_of(edge * (1 + e), 2.0, 0.5) for e in (-1e-8, 0.0, 1e-8)]
    assert [p.steady > 0 for p in around] == [False, False, True]
    durations = [p.duration for p in around]
    np.testing.assert_allclose(durations, 8.0, rtol=2e-8)
    assert durations == sorted(durations)


def test_ramp_too_short_to_have_a_length_is_none():
    assert profile_of(1.0, 2.0, 1e7) == Profile(0.0, 0.5, 2.0)
