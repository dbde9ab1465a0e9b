"""The WGS-84 Earth: radii of curvature, normal gravity and rotation rate.

Scalar functions, compiled so that the navigation kernel and the Python layer share one formula: the
gravity that truth and filter use enters all three accelerometer scale factors one to one, so there
must never be two.
"""

import numpy as np

from inscal.kernel import inlined

EARTH_RATE = 7.292115e-5
"""Rotation rate of the Earth, rad/s (WGS-84)."""
SEMI_MAJOR_AXIS = 6378137.0
"""Equatorial radius, m (WGS-84)."""
FLATTENING = 1.0 / 298.257223563
ECCENTRICITY_SQUARED = FLATTENING * (2.0 - FLATTENING)
GRAVITATIONAL_CONSTANT = 3.986004418e14
"""Geocentric gravitational constant, m^3/s^2 (WGS-84)."""
EQUATORIAL_GRAVITY = 9.7803253359
"""Normal gravity on the equator, m/s^2 (WGS-84)."""
_SOMIGLIANA_K = 1.931852652458e-3
_SEMI_MINOR_AXIS = SEMI_MAJOR_AXIS * (1.0 - FLATTENING)
_GRAVITY_M = EARTH_RATE**2 * SEMI_MAJOR_AXIS**2 * _SEMI_MINOR_AXIS / GRAVITATIONAL_CONSTANT


@inlined
def normal_gravity(sin_latitude, height):
    """Normal gravity above the ellipsoid.

    Somigliana's formula, continued upwards to second order in height (WGS-84 definition, NIMA
    TR8350.2, 3rd ed., eqs. 4-1 and 4-3).

    Parameters
    ----------
    sin_latitude : float
        Sine of geodetic latitude.
    height : float
        Height above the ellipsoid, m.

    Returns
    -------
    float
        Gravity along the ellipsoid's inner normal, m/s^2.
    """
    s2 = sin_latitude * sin_latitude
    surface = EQUATORIAL_GRAVITY * (1.0 + _SOMIGLIANA_K * s2) * _per_w(sin_latitude)
    ratio = height * (1.0 / SEMI_MAJOR_AXIS)
    return surface * (
        1.0
        - 2.0 * (1.0 + FLATTENING + _GRAVITY_M - 2.0 * FLATTENING * s2) * ratio
        + 3.0 * ratio * ratio
    )


@inlined
def radii_of_curvature(sin_latitude):
    """Radii of curvature of the ellipsoid.

    Parameters
    ----------
    sin_latitude : float
        Sine of geodetic latitude.

    Returns
    -------
    meridian, prime_vertical : float
        Radii, m (Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation
        Systems, 2nd ed., eqs. 2.105 and 2.106).
    """
    per_w = _per_w(sin_latitude)
    prime_vertical = SEMI_MAJOR_AXIS * per_w
    return prime_vertical * (1.0 - ECCENTRICITY_SQUARED) * per_w * per_w, prime_vertical


@inlined
def _per_w(sin_latitude):
    """One over sqrt(1 - e^2 sin^2 L), which gravity and both radii share."""
    return 1.0 / np.sqrt(1.0 - ECCENTRICITY_SQUARED * sin_latitude * sin_latitude)


def earth_rate_ned(latitude: float) -> np.ndarray:
    """Earth rate resolved North, East, Down.

    Parameters
    ----------
    latitude : float
        Geodetic latitude, rad.

    Returns
    -------
    ndarray, shape (3,)
        Earth rate, rad/s.
    """
    return EARTH_RATE * np.array([np.cos(latitude), 0.0, -np.sin(latitude)])


def gravity_ned(latitude: float, height: float) -> np.ndarray:
    """Normal gravity resolved North, East, Down.

    Parameters
    ----------
    latitude : float
        Geodetic latitude, rad.
    height : float
        Height above the ellipsoid, m.

    Returns
    -------
    ndarray, shape (3,)
        Gravity, m/s^2.
    """
    return np.array([0.0, 0.0, normal_gravity(np.sin(latitude), height)])
