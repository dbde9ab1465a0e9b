r"""Biases that wander: their state space, and exact integrals of them over steps of any length.

Every process is a sum of independent first-order terms, :math:`\dot x = -x/\tau + w`, with
stationary sigma :math:`\sigma`, that is noise of density :math:`q = 2\sigma^2/\tau`; a random walk
is the limit without :math:`-x/\tau`, from zero. Sensors report the integral I of x over a step, so
both are drawn together. With :math:`\phi = e^{-h/\tau}` over a step h,

.. math::

    x' = \phi x + n, \quad I = \tau(1-\phi) x + m, \quad
    var(n) = \sigma^2 (1-\phi^2), \quad cov(n, m) = \sigma^2 \tau (1-\phi)^2, \quad
    var(m) = \sigma^2 \tau^2 (2h/\tau - 3 + 4\phi - \phi^2)

(Gillespie, Exact numerical simulation of the Ornstein-Uhlenbeck process and its integral, Phys.
Rev. E 54, 1996), and for a random walk of density q: q h, q h^2/2 and q h^3/3.

**Flicker** has a flat Allan deviation. Terms of equal sigma whose time constants are equally far
apart on a logarithmic scale have, over the range that they cover, one that is flat (van der Ziel,
On the noise spectra of semi-conductor noise and of flicker effect, Physica 16, 1950). The Allan
variance of one term is (IEEE Std 952, eq. C.17)

.. math:: \sigma_A^2(T) = \frac{2\sigma^2\tau}{T}\left[1 -
    \frac{\tau}{2T}\left(3 - 4e^{-T/\tau} + e^{-2T/\tau}\right)\right] .
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inscal.disturbance import PROCESSES, Disturbance, stream
from inscal.kernel import compiled

FLICKER_RANGE = (10.0, 10_000.0)
"""Averaging times between which the Allan deviation of flicker is flat, s."""
_BEYOND = 10.0  # the terms reach so far beyond that range at both ends, as a factor
_TERMS = 6


@dataclass(frozen=True)
class Term:
    """One first-order term.

    Attributes
    ----------
    density : float
        Of the noise that drives it, (unit of x)^2/s.
    time : float
        Its time constant, s; infinite for a random walk, which starts at zero. Others start in
        their stationary distribution.
    """

    density: float
    time: float

    @property
    def initial_std(self) -> float:
        """Standard deviation at the start."""
        return 0.0 if np.isinf(self.time) else float(np.sqrt(0.5 * self.density * self.time))


def allan_variance(terms: Sequence[Term], averaging_time: np.ndarray) -> np.ndarray:
    """Allan variance of a sum of terms.

    Parameters
    ----------
    terms : sequence of Term
    averaging_time : ndarray
        s.

    Returns
    -------
    ndarray
        Of the shape of `averaging_time`.
    """
    t = np.asarray(averaging_time, dtype=float)
    total = np.zeros_like(t)
    for term in terms:
        if np.isinf(term.time):
            total += term.density * t / 3.0
            continue
        x = t / term.time
        bracket = 1.0 - (3.0 - 4.0 * np.exp(-x) + np.exp(-2.0 * x)) / (2.0 * x)
        total += term.density * term.time**2 / t * bracket
    return total


def flicker(level: float) -> list[Term]:
    """Terms whose Allan deviation is flat at `level` within `FLICKER_RANGE`."""
    first, last = FLICKER_RANGE
    times = np.geomspace(first / _BEYOND, last * _BEYOND, _TERMS)
    unit = [Term(2.0 / time, float(time)) for time in times]
    middle = allan_variance(unit, np.geomspace(first, last, 200))
    # the middle of its ripple on a logarithmic scale
    size = level**2 / np.sqrt(middle.min() * middle.max())
    return [Term(float(size * term.density), term.time) for term in unit]


def terms_of(disturbance: Disturbance, source: str) -> list[Term]:
    """State space of a source, one term per state and axis.

    Parameters
    ----------
    disturbance : Disturbance
    source : str
        Member of `inscal.disturbance.PROCESSES`.

    Returns
    -------
    list of Term
    """
    size = getattr(disturbance, source)
    if source.endswith("_walk"):
        return [Term(size**2, np.inf)]
    if source.endswith("_flicker"):
        return flicker(size)
    time = getattr(disturbance, f"{source}_time")
    return [Term(2.0 * size**2 / time, time)]


def white_like(disturbance: Disturbance, sensor: str, time: float) -> float:
    """Density of white noise that has the Allan deviation of moving biases at a time.

    What moves slowly acts on dwells of that length as if it were as large and independent.

    Parameters
    ----------
    disturbance : Disturbance
    sensor : str
        ``gyro`` or ``accel``.
    time : float
        s.

    Returns
    -------
    float
        rad/sqrt(s), m/s^2/sqrt(Hz).
    """
    present = [s for s in PROCESSES if s.startswith(sensor) and getattr(disturbance, s) > 0.0]
    terms = [term for source in present for term in terms_of(disturbance, source)]
    return float(np.sqrt(time * allan_variance(terms, np.array(time))))


def discrete(term: Term, duration: np.ndarray) -> np.ndarray:
    """Coefficients of a term in every step.

    Parameters
    ----------
    term : Term
    duration : ndarray, shape (steps,)
        s.

    Returns
    -------
    ndarray, shape (steps, 5)
        phi, the integral's gain on x, and what of two unit normals u, v goes into x' (of u alone)
        and into the integral (of u, of v).
    """
    h, q = duration, term.density
    if np.isinf(term.time):
        phi, gain = np.ones_like(h), h
        var_n, cov, rest = q * h, 0.5 * q * h**2, q * h**3 / 12.0
    else:
        tau = term.time
        x, var = h / tau, 0.5 * q * tau
        phi, gain = np.exp(-x), -tau * np.expm1(-x)
        var_n, cov = -var * np.expm1(-2.0 * x), var * tau * np.expm1(-x) ** 2
        long = np.maximum(x, 1e-2)
        var_m = var * tau**2 * (2.0 * long - 3.0 + 4.0 * np.exp(-long) - np.exp(-2.0 * long))
        # of the integral given x': the difference cancels in short steps, its limit does not
        given = var_m - (var * tau * np.expm1(-long) ** 2) ** 2 / (-var * np.expm1(-2.0 * long))
        rest = np.where(x > 1e-2, np.maximum(given, 0.0), q * h**3 / 12.0)
    root = np.sqrt(var_n)
    return np.stack([phi, gain, root, cov / root, np.sqrt(rest)], axis=1)


def add_process(
    out: np.ndarray,
    disturbance: Disturbance,
    source: str,
    duration: np.ndarray,
    *,
    seed: int,
    runs: Sequence[int],
) -> None:
    """Take the integrals of a wandering bias off the apparent increments.

    Parameters
    ----------
    out : ndarray, shape (steps, 6, LANES)
        Changed in place, rad and m/s.
    disturbance : Disturbance
    source : str
        Member of `inscal.disturbance.PROCESSES`.
    duration : ndarray, shape (steps,)
        s.
    seed : int
    runs : sequence of int, length LANES
    """
    terms = terms_of(disturbance, source)
    coefficients = np.array([discrete(term, duration) for term in terms])
    initial = np.array([term.initial_std for term in terms])
    first = 3 if source.startswith("accel") else 0
    for lane, run in enumerate(runs):
        if lane and run == runs[lane - 1]:  # spare lanes repeat the last run
            out[:, first : first + 3, lane] = out[:, first : first + 3, lane - 1]
        else:
            _walk(stream(seed, run, source), initial, coefficients, first, lane, out)


@compiled
def _walk(rng, initial, coefficients, first, lane, out):
    terms, steps = len(initial), len(out)
    x = np.empty((terms, 3))
    for t in range(terms):
        for c in range(3):
            x[t, c] = initial[t] * rng.standard_normal()
    for s in range(steps):
        for t in range(terms):
            for c in range(3):
                u, v = rng.standard_normal(), rng.standard_normal()
                k = coefficients[t, s]
                out[s, first + c, lane] -= k[1] * x[t, c] + k[3] * u + k[4] * v
                x[t, c] = k[0] * x[t, c] + k[2] * u
