r"""Attitude kernels: the rotation-vector series and the integrals of a steady turn.

For a rotation vector :math:`\theta` with cross-product matrix :math:`[\theta\times]`,

.. math::

    \exp[\theta\times] &= I + a [\theta\times] + b [\theta\times]^2, \\
    J(\theta) = \int_0^1 \exp(s [\theta\times]) ds &= I + b [\theta\times] + c [\theta\times]^2, \\
    J(\theta)^{-1} &= I - \tfrac12 [\theta\times] + d [\theta\times]^2

with :math:`a = \sin\theta/\theta`, :math:`b = (1-\cos\theta)/\theta^2`,
:math:`c = (\theta-\sin\theta)/\theta^3` and :math:`d = (1 - a / 2b) / \theta^2` (Barfoot, State
Estimation for Robotics, 2017, sec. 7.1). All four are even in the angle, so
they are power series in its square, which is what a vector unit likes best.
"""

import numpy as np

from inscal.kernel import inlined

MAX_STEP_ANGLE = 0.25
"""Largest rotation in one step, rad, for which the series below are exact to rounding."""


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
