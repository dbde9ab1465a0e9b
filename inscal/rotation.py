r"""Attitude kernels: the rotation-vector series and the integrals of a turn.

For a rotation vector :math:`\theta` with cross-product matrix :math:`[\theta\times]`,

.. math::

    \exp[\theta\times] &= I + a [\theta\times] + b [\theta\times]^2, \\
    J(\theta) = \int_0^1 \exp(s [\theta\times]) ds &= I + b [\theta\times] + c [\theta\times]^2, \\
    J(\theta)^{-1} &= I - \tfrac12 [\theta\times] + d [\theta\times]^2

with :math:`a = \sin\theta/\theta`, :math:`b = (1-\cos\theta)/\theta^2`,
:math:`c = (\theta-\sin\theta)/\theta^3` and :math:`d = (1 - a / 2b) / \theta^2` (Barfoot, State
Estimation for Robotics, 2017, sec. 7.1). All four are even in the angle, so
they are power series in its square, which is what a vector unit likes best.

**Ramps.** Where the rate changes linearly from :math:`w_0` to :math:`w_1` about a fixed axis, the
body has turned by :math:`s\theta` after the share :math:`\tau` of a step,

.. math:: s = \tau - \kappa\, \tau (1 - \tau), \qquad \kappa = \frac{w_1 - w_0}{w_1 + w_0},

so one number tells the shape of the step: 1 from rest, -1 to rest, 0 in a steady turn. Instead of J
there is :math:`J_\kappa(\theta) = \int_0^1 \exp(s [\theta\times]) d\tau`. What it has beyond J is a
power series in :math:`[\theta\times]`, whose coefficients follow from the moments
:math:`\int s^n d\tau` and :math:`\int (1-s)^n d\tau`, and whose powers fold into two as
:math:`[\theta\times]^3 = -\theta^2 [\theta\times]`. The moments that matter by themselves:

.. math::

    \int s\, d\tau = \tfrac12 - \tfrac{\kappa}{6}, \qquad
    \overline{s^2} - \bar s^2 = \tfrac{1}{12} (1 + \kappa^2/15), \qquad
    \overline{w^2} = \bar w^2 (1 + \kappa^2/3).
"""

import numpy as np

from inscal.kernel import inlined

MAX_STEP_ANGLE = 0.25
"""Largest rotation in one step, rad, for which the series below are exact to rounding."""

RAMP_TERMS = 15
"""Numbers of a step in `ramp_terms`."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
_TAU, _SHARE = 0.5 * (1.0 + _NODES), 0.5 * _WEIGHTS


@inlined
def series(x):
    """Coefficients a, b, c, d of the module docstring, as power series.

    Parameters
    ----------
    x : float
        Squared rotation angle, rad^2, at most `MAX_STEP_ANGLE` squared: the first term left out is
        below 1e-16 there, times the vectors it meets.

    Returns
    -------
    a, b, c, d : float
        sin(t)/t, (1-cos t)/t^2, (t-sin t)/t^3 and (1 - a/(2 b))/t^2.
    """
    a = 1 + x * (-1 / 6 + x * (1 / 120 + x * (-1 / 5040 + x * (1 / 362880 - x / 39916800))))
    b = 0.5 + x * (-1 / 24 + x * (1 / 720 + x * (-1 / 40320 + x * (1 / 3628800 - x / 479001600))))
    c = 1 / 6 + x * (-1 / 120 + x * (1 / 5040 + x * (-1 / 362880 + x * (1 / 39916800))))
    d = 1 / 12 + x * (
        1 / 720
        + x * (1 / 30240 + x * (1 / 1209600 + x * (1 / 47900160 + x * (691 / 1307674368000))))
    )
    return a, b, c, d


@inlined
def cross(u, v):
    """Cross product of two 3-tuples."""
    return (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])


@inlined
def turn(p, q, u, v):
    """Apply I + p [u x] + q [u x]^2 to the 3-tuple v."""
    uv = cross(u, v)
    uuv = cross(u, uv)
    return (
        v[0] + p * uv[0] + q * uuv[0],
        v[1] + p * uv[1] + q * uuv[1],
        v[2] + p * uv[2] + q * uuv[2],
    )


def skew(vector: np.ndarray) -> np.ndarray:
    """Cross-product matrix.

    Parameters
    ----------
    vector : array_like, shape (..., 3)

    Returns
    -------
    ndarray, shape (..., 3, 3)
        The matrix [v x] with [v x] u = v x u.
    """
    v = np.asarray(vector, dtype=float)
    out = np.zeros((*v.shape[:-1], 3, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return out


def mean_rotation(rotation_vector: np.ndarray) -> np.ndarray:
    """Mean of exp(s [v x]) over s in 0..1: the matrix J of the module docstring.

    Parameters
    ----------
    rotation_vector : array_like, shape (..., 3)
        Rotation vectors of any size, rad.

    Returns
    -------
    ndarray, shape (..., 3, 3)
    """
    v = np.asarray(rotation_vector, dtype=float)
    angle = np.linalg.norm(v, axis=-1)
    # sinc is exact where the angle is zero; c only meets [v x]^2, which is zero there too
    b = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    safe = np.where(angle > 1e-3, angle, 1.0)
    c = np.where(angle > 1e-3, (safe - np.sin(safe)) / safe**3, 1 / 6 - angle**2 / 120)
    s = skew(v)
    return np.eye(3) + b[..., None, None] * s + c[..., None, None] * (s @ s)


def mean_rotation_of_ramp(rotation_vector: np.ndarray, ramp: np.ndarray) -> np.ndarray:
    """Mean of exp(s [v x]) over a step whose rate changes: J_kappa of the module docstring.

    By Gauss-Legendre quadrature of twelve nodes, which is exact to rounding up to a turn of one
    radian.

    Parameters
    ----------
    rotation_vector : array_like, shape (steps, 3)
        Rad.
    ramp : array_like, shape (steps,)
        kappa of each step; where it is zero, the closed form of `mean_rotation` is taken.

    Returns
    -------
    ndarray, shape (steps, 3, 3)
    """
    v, kappa = np.asarray(rotation_vector, dtype=float), np.asarray(ramp, dtype=float)
    out = mean_rotation(v)
    bent = np.flatnonzero(kappa)
    angle = np.linalg.norm(v[bent], axis=-1)[:, None]
    phase = angle * (_TAU - kappa[bent, None] * _TAU * (1.0 - _TAU))
    k = skew(v[bent] / angle)
    sine, versine = np.sin(phase) @ _SHARE, 2.0 * np.sin(0.5 * phase) ** 2 @ _SHARE
    out[bent] = np.eye(3) + sine[:, None, None] * k + versine[:, None, None] * (k @ k)
    return out


def ramp_terms(ramp: np.ndarray) -> np.ndarray:
    r"""Series of what a ramp adds to a step of navigation.

    Parameters
    ----------
    ramp : ndarray, shape (steps,)
        kappa of the module docstring.

    Returns
    -------
    ndarray, shape (steps, RAMP_TERMS)
        kappa; then, as polynomials in the squared angle, four coefficients p and four q of
        :math:`J(\theta) J'^{-1} = I + p [\theta\times] + q [\theta\times]^2`, where J' is the mean
        of exp((1 - s) [v x]), and three each of :math:`J(-\theta) - J_\kappa(-\theta)`, which is
        as small as what it is applied to. Terms left out are below 1e-12 at `MAX_STEP_ANGLE`. Zero
        where kappa is.
    """
    out = np.zeros((len(ramp), RAMP_TERMS))
    bent = np.flatnonzero(ramp)
    kappa = ramp[bent]
    s = _TAU - kappa[:, None] * _TAU * (1.0 - _TAU)
    order = np.arange(9)
    factorial = np.cumprod(np.maximum(order, 1), dtype=float)
    ahead = (1.0 - s)[:, :, None] ** order
    ratio = _ratio(
        1.0 / (factorial * (order + 1)), np.einsum("t,stn->sn", _SHARE, ahead) / factorial
    )
    lacking = 1.0 / (order + 1) - np.einsum("t,stn->sn", _SHARE, s[:, :, None] ** order)
    lacking *= (-1.0) ** order / factorial
    folded = np.array([1.0, -1.0, 1.0, -1.0])
    out[bent, 0] = kappa
    out[bent, 1:5], out[bent, 5:9] = folded * ratio[:, 1::2], folded * ratio[:, 2::2]
    out[bent, 9:12] = folded[:3] * lacking[:, 1:6:2]
    out[bent, 12:15] = folded[:3] * lacking[:, 2:7:2]
    return out


def _ratio(numerator: np.ndarray, denominator: np.ndarray) -> np.ndarray:
    """Quotient of power series whose constant terms are one, shapes (n,) and (steps, n)."""
    out = np.zeros_like(denominator)
    for n in range(len(numerator)):
        carried = sum(denominator[:, m] * out[:, n - m] for m in range(1, n + 1))
        out[:, n] = numerator[n] - carried
    return out
