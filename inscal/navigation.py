r"""Strapdown navigation in the local North-East-Down frame.

One step takes compensated increments :math:`\Delta\theta, \Delta v` of length dt. With the body's
rotation relative to the navigation frame

.. math:: \theta = \Delta\theta - J(-\theta)\, C^T \omega_{in}\, dt

the attitude is turned, :math:`C \leftarrow C \exp[\theta\times]`, and the velocity gains

.. math:: \Delta v^n = C J(\theta)^{-1} \Delta v + (g - (2\omega_{ie} + \omega_{en}) \times V) dt

with the new C and J of `inscal.rotation`. This is exact, at any step size, for a body that turns
steadily while its specific force is constant in the navigation frame, which is what a turntable
does; for general motion it is second order like the usual coning and sculling terms (Savage,
Strapdown Analytics, 2000, ch. 7). Attitude first and velocity after it makes the Schuler loop a
symplectic Euler scheme: it neither grows nor decays.

**Ramps.** Where the table's rate changes within a step, J is :math:`J_\kappa` of `inscal.rotation`
throughout. Rather than navigate otherwise, `straightened` turns the increments of such a step into
those that a steady turn to the same attitude would have given,

.. math::

    \Delta\theta &\leftarrow \Delta\theta
        + (J(-\theta) - J_\kappa(-\theta))\, C^T \omega_{ie}\, dt \\
    \Delta v &\leftarrow J(-\theta)\, J_\kappa(-\theta)^{-1} \Delta v

with the old C. It has to know how the rate was planned to change, but not by how much nor where to.

Position is kept as offsets from the site (rad of latitude and longitude, m of height), so the sines
of latitude are short series, good to rounding within `MAX_OFFSET`.
"""

import numpy as np

from inscal import earth
from inscal.kernel import inlined, spliced
from inscal.motion import Site
from inscal.rotation import cross, series, turn

MAX_OFFSET = 0.01
"""Largest latitude offset from the site, rad (64 km), for which its series is exact to rounding."""

ATTITUDE, VELOCITY, POSITION, ROWS = 0, 9, 12, 15
"""First rows of the body-to-NED matrix (row by row), velocity and position, and their count."""


def site_constants(site: Site) -> tuple[float, float, float]:
    """Sine and cosine of latitude, and height: what `advance` needs to know of a site."""
    return float(np.sin(site.latitude)), float(np.cos(site.latitude)), site.height


@inlined
def advance(state, row, j, angle, velocity, dt, site):
    """Navigate lane `j` through one step.

    Parameters
    ----------
    state : ndarray, shape (rows, lanes)
        Rows ``row`` to ``row + 14`` hold the attitude matrix, velocity North, East, Down (m/s) and
        the position offsets latitude, longitude (rad) and height (m); updated in place.
    row : int
        First of those rows.
    j : int
        Lane.
    angle, velocity : tuple of 3 float
        Compensated increments, rad and m/s.
    dt : float
        Length of the step, s.
    site : tuple of float
        From `site_constants`.
    """
    at, vel, pos = row + ATTITUDE, row + VELOCITY, row + POSITION
    v = (state[vel, j], state[vel + 1, j], state[vel + 2, j])
    offset = state[pos, j]
    height = site[2] + state[pos + 2, j]
    sin_lat, cos_lat = _latitude(offset, site)
    per_n, per_e, per_cos = _reciprocals(sin_lat, cos_lat, height)
    ie = (earth.EARTH_RATE * cos_lat, 0.0, -earth.EARTH_RATE * sin_lat)
    en = (v[1] * per_e, -v[0] * per_n, -v[1] * per_e * sin_lat * per_cos)
    c = (
        (state[at, j], state[at + 1, j], state[at + 2, j]),
        (state[at + 3, j], state[at + 4, j], state[at + 5, j]),
        (state[at + 6, j], state[at + 7, j], state[at + 8, j]),
    )
    t = _turned(angle, c, ((ie[0] + en[0]) * dt, en[1] * dt, (ie[2] + en[2]) * dt))
    c, force = _turn(c, t, velocity)
    state[at, j], state[at + 1, j], state[at + 2, j] = c[0]
    state[at + 3, j], state[at + 4, j], state[at + 5, j] = c[1]
    state[at + 6, j], state[at + 7, j], state[at + 8, j] = c[2]
    gained = _to_navigation(c, force)
    coriolis = cross((2.0 * ie[0] + en[0], en[1], 2.0 * ie[2] + en[2]), v)
    gravity = earth.normal_gravity(sin_lat, height)
    n = (
        v[0] + gained[0] - coriolis[0] * dt,
        v[1] + gained[1] - coriolis[1] * dt,
        v[2] + gained[2] + (gravity - coriolis[2]) * dt,
    )
    state[vel, j], state[vel + 1, j], state[vel + 2, j] = n
    state[pos, j] = offset + 0.5 * (v[0] + n[0]) * per_n * dt
    state[pos + 1, j] += 0.5 * (v[1] + n[1]) * per_e * per_cos * dt
    state[pos + 2, j] -= 0.5 * (v[2] + n[2]) * dt


@spliced
def _latitude(offset, site):
    """Sine and cosine of the latitude at an offset from the site, rad."""
    o2 = offset * offset
    sin_o = offset * (1.0 - o2 * (1 / 6 - o2 * (1 / 120)))
    cos_o = 1.0 - o2 * (0.5 - o2 * (1 / 24 - o2 * (1 / 720)))
    return site[0] * cos_o + site[1] * sin_o, site[1] * cos_o - site[0] * sin_o


@spliced
def _reciprocals(sin_lat, cos_lat, height):
    """One over the radii of motion north and east, 1/m, and over the cosine of latitude."""
    meridian, prime_vertical = earth.radii_of_curvature(sin_lat)
    radius_n, radius_e = meridian + height, prime_vertical + height
    # three reciprocals for the price of one division
    inverse = 1.0 / (radius_n * radius_e * cos_lat)
    return (
        inverse * radius_e * cos_lat,
        inverse * radius_n * cos_lat,
        inverse * radius_n * radius_e,
    )


@spliced
def _turned(angle, c, w):
    """Turn of the body relative to the navigation frame, whose own turn is `w`; all in rad."""
    frame = _to_body(c, w)
    # the frame turns slowly: a turn good to second order is good enough inside its J
    slip = cross(angle, frame)
    t = (
        angle[0] - frame[0] + 0.5 * slip[0],
        angle[1] - frame[1] + 0.5 * slip[1],
        angle[2] - frame[2] + 0.5 * slip[2],
    )
    _, b, e, _ = series(t[0] * t[0] + t[1] * t[1] + t[2] * t[2])
    frame = turn(-b, e, t, frame)
    return angle[0] - frame[0], angle[1] - frame[1], angle[2] - frame[2]


@spliced
def _turn(c, t, velocity):
    """Attitude after a turn `t`, and a velocity increment in the axes that it ends in."""
    a, b, _, d = series(t[0] * t[0] + t[1] * t[1] + t[2] * t[2])
    force = turn(-0.5, d, t, velocity)
    minus = (-t[0], -t[1], -t[2])
    return (turn(a, b, minus, c[0]), turn(a, b, minus, c[1]), turn(a, b, minus, c[2])), force


@spliced
def _to_body(c, u):
    """Components of a vector in the body, C^T u."""
    return (
        c[0][0] * u[0] + c[1][0] * u[1] + c[2][0] * u[2],
        c[0][1] * u[0] + c[1][1] * u[1] + c[2][1] * u[2],
        c[0][2] * u[0] + c[1][2] * u[1] + c[2][2] * u[2],
    )


@spliced
def _to_navigation(c, u):
    """Components of a vector in the navigation frame, C u."""
    return (
        c[0][0] * u[0] + c[0][1] * u[1] + c[0][2] * u[2],
        c[1][0] * u[0] + c[1][1] * u[1] + c[1][2] * u[2],
        c[2][0] * u[0] + c[2][1] * u[1] + c[2][2] * u[2],
    )


@inlined
def straightened(state, row, j, angle, velocity, dt, site, terms, s):
    """Increments of a steady turn from those of a step whose rate changes.

    Parameters
    ----------
    state : ndarray, shape (rows, lanes)
        As of `advance`, at the start of the step.
    row, j : int
        As of `advance`.
    angle, velocity : tuple of 3 float
        Compensated increments, rad and m/s.
    dt : float
        Length of the step, s.
    site : tuple of float
        From `site_constants`. The velocity's part in the turn of the frame is left out: of 1 m/s in
        a step of 1 s it is 2e-7 rad, and a hundredth of that is what this is about.
    terms : ndarray, shape (steps, RAMP_TERMS)
        From `inscal.rotation.ramp_terms`.
    s : int
        Step.

    Returns
    -------
    angle, velocity : tuple of 3 float
        For `advance`.
    """
    at = row + ATTITUDE
    north, down = earth.EARTH_RATE * site[1] * dt, -earth.EARTH_RATE * site[0] * dt
    frame = (
        state[at, j] * north + state[at + 6, j] * down,
        state[at + 1, j] * north + state[at + 7, j] * down,
        state[at + 2, j] * north + state[at + 8, j] * down,
    )
    # the frame turns slowly: as in `advance` a turn good to second order will do
    slip, half = cross(angle, frame), 0.5 + terms[s, 1]
    t = (
        angle[0] - frame[0] + half * slip[0],
        angle[1] - frame[1] + half * slip[1],
        angle[2] - frame[2] + half * slip[2],
    )
    x = t[0] * t[0] + t[1] * t[1] + t[2] * t[2]
    p = terms[s, 1] + x * (terms[s, 2] + x * (terms[s, 3] + x * terms[s, 4]))
    q = terms[s, 5] + x * (terms[s, 6] + x * (terms[s, 7] + x * terms[s, 8]))
    a = terms[s, 9] + x * (terms[s, 10] + x * terms[s, 11])
    b = terms[s, 12] + x * (terms[s, 13] + x * terms[s, 14])
    bent = turn(a, b, t, frame)
    angle = (
        angle[0] + (bent[0] - frame[0]),
        angle[1] + (bent[1] - frame[1]),
        angle[2] + (bent[2] - frame[2]),
    )
    return angle, turn(p, q, t, velocity)


@inlined
def rotate_left(state, row, j, phi):
    """Turn the attitude of lane `j` by a rotation vector in the navigation frame.

    Parameters
    ----------
    state : ndarray, shape (rows, lanes)
    row : int
        First row of the attitude matrix C, which becomes exp[phi x] C.
    j : int
        Lane.
    phi : tuple of 3 float
        Rotation vector, rad.
    """
    a, b, _, _ = series(phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2])
    for i in range(3):
        column = turn(a, b, phi, (state[row + i, j], state[row + 3 + i, j], state[row + 6 + i, j]))
        state[row + i, j], state[row + 3 + i, j], state[row + 6 + i, j] = column
