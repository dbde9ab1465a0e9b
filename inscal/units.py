"""Paper units and SI: the one place where the two meet.

Inside the library every quantity is SI (rad, rad/s, m/s^2, s^2/m, m). Tables, stores and
configuration speak the units of the calibration laboratory; each constant here is the size of one
such unit in SI, so ``value_si = value * UNIT`` and ``value = value_si / UNIT``.
"""

from math import pi

STANDARD_GRAVITY = 9.80665
"""Standard acceleration of gravity, m/s^2 (the g of a ug)."""

DEGREE = pi / 180.0
ARCSEC = DEGREE / 3600.0
DEG_PER_HOUR = DEGREE / 3600.0
DEG_PER_SQRT_HOUR = DEGREE / 60.0
"""One deg/sqrt(h) of angle random walk, in rad/sqrt(s)."""

MICRO_G = 1e-6 * STANDARD_GRAVITY
"""One ug, in m/s^2; also one ug/sqrt(Hz) of white noise, in m/s^2/sqrt(Hz)."""

PPM = 1e-6
MILLIMETRE = 1e-3
MILLIGAL = 1e-5
NAUTICAL_MILE = 1852.0
QUADRATIC_SI_FACE_VALUE = 1e-9
"""One 1e-9 s^2/m of accelerometer quadratic coefficient, read at SI face value."""


def quadratic_unit(pulses_per_m_per_s: float) -> float:
    """Size in s^2/m of one 1e-9 of quadratic coefficient read in the pulse domain.

    The paper writes the quadratic term on pulse rates, ka (Na + D2 Na^2) (eq. 3). With N pulses
    per m/s the rate is N f, so a coefficient of 1e-9 s/pulse acts as N * 1e-9 s^2/m on specific
    force.

    Parameters
    ----------
    pulses_per_m_per_s : float
        Accelerometer scale factor, pulses per m/s (the paper's Table 4 has about 1673.84).

    Returns
    -------
    float
        Unit size, s^2/m.
    """
    return pulses_per_m_per_s * 1e-9
