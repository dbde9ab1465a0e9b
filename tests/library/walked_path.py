"""A path walked through by quadrature of rates and forces, of nothing but the schedule."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from inscal import earth
from inscal.schedule import segments

NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)


@dataclass
class Part:
    """Rest, steady turn or ramp from one time to another, with attitude and rate at its start."""

    start: float
    end: float
    attitude: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray

    def rate_at(self, t):
        return self.rate + (t - self.start) * self.acceleration

    def attitude_at(self, t):
        since = t - self.start
        turned = since * self.rate + 0.5 * since**2 * self.acceleration
        return self.attitude @ Rotation.from_rotvec(turned).as_matrix()


def parts_of(schedule, rates=lambda turn, rate: rate):
    """Parts of a schedule whose turns may have other rates: a linear function of the planned."""
    parts, attitude = [], segments(schedule)[0].attitude
    for planned in segments(schedule):
        both = (rates(planned.turn, x) for x in (planned.rate, planned.acceleration))
        parts.append(Part(planned.start, planned.end, attitude, *both))
        attitude = parts[-1].attitude_at(planned.end)
    return parts


def walk(site, parts, edges, function):
    """Integrals over the steps between edges of a function of time and part, (steps, n)."""
    cuts = np.unique(np.concatenate([edges, [part.start for part in parts]]))
    cuts = cuts[np.concatenate([[True], np.diff(cuts) > 1e-9])]
    pieces = []
    for a, b in pairwise(cuts):
        part = next(p for p in parts if p.start - 1e-9 <= a and b <= p.end + 1e-9)
        times = 0.5 * (a + b) + 0.5 * (b - a) * NODES
        values = np.array([function(t, part) for t in times])
        pieces.append(0.5 * (b - a) * (WEIGHTS @ values))
    first = np.searchsorted(cuts, edges[:-1] - 1e-9)
    return np.add.reduceat(np.array(pieces), first, axis=0)


def seen(site, *, gravity=None, earth_rate=None):
    """Rate and force of a unit at a site, a function for `walk`."""
    g = earth.gravity_ned(site.latitude, site.height) if gravity is None else gravity
    w = earth.earth_rate_ned(site.latitude) if earth_rate is None else earth_rate

    def function(t, part):
        to_body = part.attitude_at(t).T
        return np.concatenate([part.rate_at(t) + to_body @ w, to_body @ -g])

    return function
