import numpy as np
import pytest

from inscal import earth


def test_normal_gravity_at_pole_and_equator():
    assert earth.normal_gravity(0.0, 0.0) == pytest.approx(9.7803253359, abs=1e-10)
    assert earth.normal_gravity(1.0, 0.0) == pytest.approx(9.8321849378, abs=1e-9)


def test_gravity_falls_with_height_as_in_free_air():
    s = np.sin(np.deg2rad(45.0))
    gradient = (earth.normal_gravity(s, 100.0) - earth.normal_gravity(s, -100.0)) / 200.0
    assert gradient == pytest.approx(-3.086e-6, rel=1e-3)


def test_gravity_above_the_equator_against_spherical_harmonics():
    # GM/r^2 (1 + 3/2 J2 (a/r)^2 - 15/8 J4 (a/r)^4) - w^2 r on the equator
    r = earth.SEMI_MAJOR_AXIS + 3000.0
    j2, j4, ratio = 1.082629821e-3, -2.37091222e-6, earth.SEMI_MAJOR_AXIS / r
    attraction = earth.GRAVITATIONAL_CONSTANT / r**2
    attraction *= 1 + 1.5 * j2 * ratio**2 - 1.875 * j4 * ratio**4
    expected = attraction - earth.EARTH_RATE**2 * r
    assert earth.normal_gravity(0.0, 3000.0) == pytest.approx(expected, abs=5e-7)


def test_radii_of_curvature_against_the_meridian_ellipse():
    latitude = np.deg2rad(39.98)
    a, e2 = earth.SEMI_MAJOR_AXIS, earth.ECCENTRICITY_SQUARED

    def point(lat):  # meridian section: distance from the axis, height over the equator
        n = a / np.sqrt(1 - e2 * np.sin(lat) ** 2)
        return np.array([n * np.cos(lat), n * (1 - e2) * np.sin(lat)])

    step = 1e-5
    speed = np.linalg.norm(point(latitude + step) - point(latitude - step)) / (2 * step)
    meridian, prime_vertical = earth.radii_of_curvature(np.sin(latitude))
    assert meridian == pytest.approx(speed, rel=1e-8)
    assert prime_vertical * np.cos(latitude) == pytest.approx(point(latitude)[0], rel=1e-12)


def test_earth_rate_points_to_the_pole():
    rate = earth.earth_rate_ned(np.deg2rad(30.0))
    assert np.linalg.norm(rate) == pytest.approx(earth.EARTH_RATE)
    assert rate[2] / rate[0] == pytest.approx(-np.tan(np.deg2rad(30.0)))
