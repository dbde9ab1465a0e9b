r"""A first guess of a unit whose scales are known to some percent, from its rests and turns alone.

At rest the specific force has the length of gravity, and a turn R between two rests, added up from
the gyros, carries one force into the next: with f_i the mean force of rest i

.. math:: |f_i| = g, \qquad f_{i+1} = R_i^T f_i ,

while gyros at rest report next to nothing. Least squares of all that over the biases and both
matrices is the multi-position calibration of Tedaldi, Pretto and Menegatti (A robust and easy to
implement method for IMU calibration without external equipments, ICRA 2014), here in the axes of
the gyros. The Earth's rate is left out: it is below what such units resolve.
"""

import itertools
from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from inscal import earth
from inscal.motion import Site
from inscal.parameters import COUNT, GROUPS, INDEX
from inscal.recorded import Increments, Stretch, turned_between
from inscal.sensor import matrices

_UNKNOWN = np.r_[INDEX["gyro_bias"], INDEX["accel_bias"], INDEX["gyro_k"], INDEX["accel_k"]]
_SIZE = np.r_[np.full(3, 0.01), np.full(3, 0.1), np.full(15, 0.1)]  # rad/s, m/s^2 and 1
_WEAK = 1e-3  # pull to zero of what a record does not show, per size
_REST = 10.0  # s, by which a rate at rest counts as an angle


def first_guess(record: Increments, parts: Sequence[Stretch], site: Site) -> np.ndarray:
    """Biases and matrices that make rests and turns fit each other.

    Parameters
    ----------
    record : Increments
    parts : sequence of Stretch
        Of the record.
    site : Site

    Returns
    -------
    ndarray, shape (27,)
        SI; zero where nothing is guessed.
    """
    rests = [part for part in parts if not part.turns]
    rate, force = (
        np.array([x[part.first : part.end].mean(axis=0) for part in rests]) / record.interval
        for x in (record.angle, record.velocity)
    )
    bounds = np.array([(a.end, b.first) for a, b in itertools.pairwise(rests)])
    gravity = float(earth.gravity_ned(site.latitude, site.height)[2])
    angle = np.ascontiguousarray(record.angle)

    def misfit(scaled: np.ndarray) -> np.ndarray:
        gyro, accel, bias = _matrices(scaled)
        f = (force @ accel.T + bias[1]) / gravity
        turned = turned_between(angle, bounds, gyro, bias[0] * record.interval)
        carried = np.einsum("kij,ki->kj", turned, f[:-1])
        still = _REST * (rate @ gyro.T + bias[0])
        length = np.linalg.norm(f, axis=1) - 1.0
        parts = (f[1:] - carried).ravel(), length, still.ravel(), _WEAK * scaled
        return np.concatenate(parts)

    found = least_squares(misfit, np.zeros(len(_UNKNOWN)), method="lm").x
    out = np.zeros(COUNT)
    out[_UNKNOWN] = found * _SIZE
    return out


def composed(first: np.ndarray, then: np.ndarray) -> np.ndarray:
    """Parameters that compensate at once as two sets of them do one after the other.

    Parameters
    ----------
    first, then : ndarray, shape (27,)
        SI. Of the first, biases and matrices alone.

    Returns
    -------
    ndarray, shape (27,)
    """
    out = then.copy()
    one, other = (np.eye(3) + matrices(p[:, None])[:, 0] for p in (first, then))
    out[:6] += (other @ first[:6].reshape(2, 3, 1)).ravel()
    both = other @ one - np.eye(3)
    for sensor, group in enumerate(("gyro_k", "accel_k")):
        place = [(int(name[-2]) - 1, int(name[-1]) - 1) for name in GROUPS[group]]
        out[INDEX[group]] = [both[sensor][at] for at in place]
    return out


def _matrices(scaled: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What compensates: matrices of gyros and accelerometers, biases (2, 3)."""
    whole = np.zeros(COUNT)
    whole[_UNKNOWN] = scaled * _SIZE
    gyro, accel = np.eye(3) + matrices(whole[:, None])[:, 0]
    return gyro, accel, whole[:6].reshape(2, 3)
