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


@pytest.mark.parametrize("degrees", [39.98, -40.0, 0.0, -70.0, 89.0])
def test_radii_of_curvature_against_the_meridian_ellipse(degrees):
    latitude = np.deg2rad(degrees)
    a, e2 = earth.SEMI_MAJOR_AXIS, earth.ECCENTRICITY_SQUARED

    def point(lat):  # meridian section: distance from the axis, height over the equator
        n = a / np.sqrt(1 - e2 * np.sin(lat) ** 2)
        return np.array([n * np.cos(lat), n * (1 - e2) * np.sin(lat)])

    step = 1e-5
    speed = np.linalg.norm(point(latitude + step) - point(latitude - step)) / (2 * step)
    meridian, prime_vertical = earth.radii_of_curvature(np.sin(latitude))
    assert meridian == pytest.approx(speed, rel=1e-8)
    assert prime_vertical * np.cos(latitude) == pytest.approx(point(latitude)[0], rel=1e-12)


@pytest.mark.parametrize("degrees", [30.0, -40.0, 0.0, 89.9, -89.9])
def test_earth_rate_is_along_the_axis(degrees):
    # north, east and up at longitude 0 in axes of the Earth, z along its axis
    latitude = np.deg2rad(degrees)
    north = np.array([-np.sin(latitude), 0.0, np.cos(latitude)])
    up = np.array([np.cos(latitude), 0.0, np.sin(latitude)])
    rate = earth.earth_rate_ned(latitude)
    found = rate[0] * north + rate[1] * np.array([0.0, 1.0, 0.0]) - rate[2] * up
    np.testing.assert_allclose(found, [0.0, 0.0, 7.292115e-5], atol=1e-19)


@pytest.mark.parametrize("degrees", [-65.0, -12.0, 25.0, 80.0])
@pytest.mark.parametrize("height", [-300.0, 4000.0])
def test_gravity_elsewhere_against_spherical_harmonics(degrees, height):
    """Gradient of the ellipsoid's potential, by differences along the normal."""
    latitude, a = np.deg2rad(degrees), earth.SEMI_MAJOR_AXIS
    e2 = earth.ECCENTRICITY_SQUARED
    j2, j4, j6 = 1.082629821e-3, -2.37091222e-6, 6.08347e-9

    def potential(h):
        n = a / np.sqrt(1 - e2 * np.sin(latitude) ** 2)
        x, z = (n + h) * np.cos(latitude), (n * (1 - e2) + h) * np.sin(latitude)
        r = np.hypot(x, z)
        legendre = [np.polynomial.legendre.Legendre.basis(k)(z / r) for k in (2, 4, 6)]
        terms = zip((j2, j4, j6), (2, 4, 6), legendre, strict=True)
        series = 1 - sum(j * (a / r) ** k * p for j, k, p in terms)
        return earth.GRAVITATIONAL_CONSTANT / r * series + 0.5 * (earth.EARTH_RATE * x) ** 2

    step = 50.0
    expected = (potential(height - step) - potential(height + step)) / (2 * step)
    assert earth.normal_gravity(np.sin(latitude), height) == pytest.approx(expected, abs=2e-6)
    down = earth.gravity_ned(latitude, height)
    assert down.tolist() == [0.0, 0.0, earth.normal_gravity(np.sin(latitude), height)]
