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
    """Rest or steady turn from one time to another, with the attitude at its start."""

    start: float
    end: float
    attitude: np.ndarray
    rate: np.ndarray

    def attitude_at(self, t):
        return self.attitude @ Rotation.from_rotvec((t - self.start) * self.rate).as_matrix()


def parts_of(schedule, rates=lambda turn, rate: rate):
    """Parts of a schedule whose turns may have other rates."""
    parts, attitude, turn = [], segments(schedule)[0].attitude, 0
    for planned in segments(schedule):
        rate, start, end = planned.rate, planned.start, planned.end
        if rate.any():
            rate = rates(turn, rate)
            turn += 1
        parts.append(Part(start, end, attitude, rate))
        attitude = parts[-1].attitude_at(end)
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
        return np.concatenate([part.rate + to_body @ w, to_body @ -g])

    return function
