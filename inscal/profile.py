r"""The rate of a turn over time: at once at full rate, or with ramps at both ends.

A turn of amount A at rate w with acceleration a is a trapezoid: it reaches w in w/a, keeps it for
A/w - w/a and loses it in w/a again, :math:`A/w + w/a` in all. Where A is below w^2/a it turns back
from a peak of :math:`\sqrt{aA}` at once, a triangle of :math:`2\sqrt{A/a}` (Biagiotti and
Melchiorri, Trajectory Planning for Automatic Machines and Robots, 2008, sec. 3.2).
"""

import math
from dataclasses import dataclass

_SHORTEST = 1e-6
"""Ramps shorter than this, s, are none: no sensor is read so fast, and steps have a length."""


@dataclass(frozen=True)
class Profile:
    """Rate of a turn over time, symmetric.

    Attributes
    ----------
    ramp : float
        Length of the ramp at each end, s; 0 where the turn starts and stops at once.
    steady : float
        Time at the peak rate between them, s; 0 in a triangle.
    rate : float
        Peak rate, rad/s.
    """

    ramp: float
    steady: float
    rate: float

    @property
    def duration(self) -> float:
        """Time from rest to rest, s."""
        return 2.0 * self.ramp + self.steady


def profile_of(angle: float, rate: float, acceleration: float | None) -> Profile:
    """Rate of a turn over time.

    Parameters
    ----------
    angle : float
        Amount of the turn, above zero; rad, or any unit that the others share.
    rate : float
        Highest rate, 1/s.
    acceleration : float or None
        Of the ramps, 1/s^2; None: at once.

    Returns
    -------
    Profile
    """
    at_once = Profile(0.0, angle / rate, rate)
    if acceleration is None or rate / acceleration < _SHORTEST:
        return at_once
    steady = at_once.steady - rate / acceleration
    # what rounding alone leaves of a plateau is none
    if steady > 1e-9 * at_once.steady:
        return Profile(rate / acceleration, steady, rate)
    return Profile(math.sqrt(angle / acceleration), 0.0, math.sqrt(angle * acceleration))
