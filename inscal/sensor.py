"""The sensor model and its compensation, exact inverses of each other (paper eqs. 1-3).

True rate and specific force follow from what the sensors give by

    w = (I + dKg) w_meas + eps
    f = (I + dKa)(f_meas + D2 . f_meas^2) + nabla + f_L,   f_L,i = (w_j^2 + w_k^2) r_i

with dKg lower triangular. The outer sign of f_L is the geometric one: an accelerometer outside the
centre of rotation loses the centripetal part, so compensation adds it.

Both are applied to the increments of a step, that is to means over it. Of the quadratic term the
mean is D2 (mean(f)^2 + var(f)), and in a turn the variance within a step is not nothing: f turns in
the body by the step's rotation vector theta, so to leading order var(f) = (theta x f)^2 / 12,
element-wise. `spread_force` is that part. Left out, it would look like 0.1 mm of lever arm at 5 deg
a step. Where the table's rate changes within a step, the mean of w^2 is not the square of the mean
either, and f spreads a little farther; `ramp_force` is what that adds. A lever arm's tangential
part dw/dt x r has no component along r, where the accelerometer looks.

The functions work on lane ``j`` of an array with one row per parameter in state order (more rows
may follow), so that lane loops vectorise; they are plain functions in Python too.
"""

import numpy as np

from inscal.kernel import inlined
from inscal.parameters import INDEX
from inscal.rotation import cross

_EPS = INDEX["gyro_bias"].start
_NABLA = INDEX["accel_bias"].start
_KG = INDEX["gyro_k"].start
_KA = INDEX["accel_k"].start
_D2 = INDEX["accel_quadratic"].start
_R = INDEX["lever_arm"].start


def matrices(parameters: np.ndarray) -> np.ndarray:
    """Scale factor errors and installation angles as matrices.

    Parameters
    ----------
    parameters : ndarray, shape (27 or more, lanes)
        In state order, SI.

    Returns
    -------
    ndarray, shape (2, lanes, 3, 3)
        dKg and dKa.
    """
    lanes = parameters.shape[1]
    both = np.zeros((2, lanes, 3, 3))
    columns, rows = np.triu_indices(3)  # a lower triangle column by column
    both[0][:, rows, columns] = parameters[INDEX["gyro_k"]].T
    both[1] = parameters[INDEX["accel_k"]].T.reshape(lanes, 3, 3).mT
    return both


def inverse_matrices(truth: np.ndarray) -> np.ndarray:
    """Inverses of I + dKg and I + dKa.

    Parameters
    ----------
    truth : ndarray, shape (27, lanes)
        Parameters in state order, SI.

    Returns
    -------
    ndarray, shape (15, lanes)
        The six entries of the lower triangular gyro inverse and the nine of the accelerometers',
        each column by column as in `truth`.
    """
    columns, rows = np.triu_indices(3)
    gyro_inverse, accel_inverse = np.linalg.inv(np.eye(3) + matrices(truth))
    accel_columns = accel_inverse.mT.reshape(truth.shape[1], 9)
    return np.concatenate([gyro_inverse[:, rows, columns].T, accel_columns.T])


@inlined
def lever_arm_force(p, j, w):
    """Specific force that the inner lever arms take away, m/s^2, at body rate `w`, rad/s."""
    x, y, z = w[0] * w[0], w[1] * w[1], w[2] * w[2]
    return (y + z) * p[_R, j], (z + x) * p[_R + 1, j], (x + y) * p[_R + 2, j]


@inlined
def spread_force(p, j, angle, velocity, rate):
    """Velocity increment, m/s, that the variance of f within a step adds to the quadratic term.

    Parameters
    ----------
    p : ndarray, shape (27 or more, lanes)
    j : int
        Lane.
    angle, velocity : tuple of 3 float
        True increments of the step, rad and m/s, the latter without this part.
    rate : float
        One over the length of the step, 1/s.

    Returns
    -------
    tuple of 3 float
    """
    t = cross(angle, velocity)
    share = rate * (1.0 / 12.0)
    return (
        p[_D2, j] * t[0] * t[0] * share,
        p[_D2 + 1, j] * t[1] * t[1] * share,
        p[_D2 + 2, j] * t[2] * t[2] * share,
    )


@inlined
def ramp_force(p, j, angle, velocity, dt, ramp):
    """Velocity increment, m/s, of lever arms and quadratic terms beyond that of a steady turn.

    Parameters
    ----------
    p : ndarray, shape (27 or more, lanes)
    j : int
        Lane.
    angle, velocity : tuple of 3 float
        True increments of the step, rad and m/s, the latter without this part.
    dt : float
        Length of the step, s.
    ramp : float
        kappa of `inscal.rotation`, which has the moments of such a step.

    Returns
    -------
    tuple of 3 float
    """
    rate = 1.0 / dt
    square = ramp * ramp
    lever = lever_arm_force(p, j, (angle[0] * rate, angle[1] * rate, angle[2] * rate))
    spread = spread_force(p, j, angle, velocity, rate)
    of_lever, of_spread = square * dt * (1.0 / 3.0), square * (1.0 / 15.0)
    return (
        lever[0] * of_lever + spread[0] * of_spread,
        lever[1] * of_lever + spread[1] * of_spread,
        lever[2] * of_lever + spread[2] * of_spread,
    )


@inlined
def sense(p, inverse, j, angle, velocity, angle_noise, velocity_noise, dt):
    """Increments that imperfect sensors report.

    Parameters
    ----------
    p : ndarray, shape (27, lanes)
        True parameters, SI.
    inverse : ndarray, shape (15, lanes)
        From `inverse_matrices`.
    j : int
        Lane.
    angle, velocity : tuple of 3 float
        True increments, rad and m/s.
    angle_noise, velocity_noise : tuple of 3 float
        White noise of the step on the model's right-hand side, rad and m/s.
    dt : float
        Length of the step, s.

    Returns
    -------
    angle, velocity : tuple of 3 float
        Reported increments, rad and m/s; NaN where the quadratic term allows no solution.
    """
    rate = 1.0 / dt
    lever = lever_arm_force(p, j, (angle[0] * rate, angle[1] * rate, angle[2] * rate))
    # compensation knows the force only without its spread: two rounds find that to rounding
    spread = spread_force(p, j, angle, velocity, rate)
    near = (velocity[0] - spread[0], velocity[1] - spread[1], velocity[2] - spread[2])
    spread = spread_force(p, j, angle, near, rate)
    wx = angle[0] - angle_noise[0] - p[_EPS, j] * dt
    wy = angle[1] - angle_noise[1] - p[_EPS + 1, j] * dt
    wz = angle[2] - angle_noise[2] - p[_EPS + 2, j] * dt
    fx = rate * (velocity[0] - velocity_noise[0] - spread[0]) - p[_NABLA, j] - lever[0]
    fy = rate * (velocity[1] - velocity_noise[1] - spread[1]) - p[_NABLA + 1, j] - lever[1]
    fz = rate * (velocity[2] - velocity_noise[2] - spread[2]) - p[_NABLA + 2, j] - lever[2]
    g = inverse
    return (
        g[0, j] * wx,
        g[1, j] * wx + g[3, j] * wy,
        g[2, j] * wx + g[4, j] * wy + g[5, j] * wz,
    ), (
        dt * _unsquare(p[_D2, j], g[6, j] * fx + g[9, j] * fy + g[12, j] * fz),
        dt * _unsquare(p[_D2 + 1, j], g[7, j] * fx + g[10, j] * fy + g[13, j] * fz),
        dt * _unsquare(p[_D2 + 2, j], g[8, j] * fx + g[11, j] * fy + g[14, j] * fz),
    )


@inlined
def _unsquare(d2, u):
    """Solve f + d2 f^2 = u for the root near u, without cancellation when d2 is small."""
    return 2.0 * u / (1.0 + np.sqrt(1.0 + 4.0 * d2 * u))


@inlined
def compensate(p, j, angle, velocity, dt):
    """Increments of a step, corrected by estimated parameters: the inverse of `sense`.

    Parameters
    ----------
    p : ndarray, shape (27 or more, lanes)
        Estimated parameters in the first 27 rows, SI.
    j : int
        Lane.
    angle, velocity : tuple of 3 float
        Reported increments, rad and m/s.
    dt : float
        Length of the step, s.

    Returns
    -------
    angle, velocity : tuple of 3 float
        Compensated increments, rad and m/s.
    """
    rate = 1.0 / dt
    wx = angle[0] + p[_KG, j] * angle[0] + p[_EPS, j] * dt
    wy = angle[1] + p[_KG + 1, j] * angle[0] + p[_KG + 3, j] * angle[1] + p[_EPS + 1, j] * dt
    wz = (
        angle[2]
        + p[_KG + 2, j] * angle[0]
        + p[_KG + 4, j] * angle[1]
        + p[_KG + 5, j] * angle[2]
        + p[_EPS + 2, j] * dt
    )
    lever = lever_arm_force(p, j, (wx * rate, wy * rate, wz * rate))
    fx = velocity[0] + p[_D2, j] * velocity[0] * velocity[0] * rate
    fy = velocity[1] + p[_D2 + 1, j] * velocity[1] * velocity[1] * rate
    fz = velocity[2] + p[_D2 + 2, j] * velocity[2] * velocity[2] * rate
    k = _KA
    v = (
        fx + (p[k, j] * fx + p[k + 3, j] * fy + p[k + 6, j] * fz) + (p[_NABLA, j] + lever[0]) * dt,
        fy
        + (p[k + 1, j] * fx + p[k + 4, j] * fy + p[k + 7, j] * fz)
        + (p[_NABLA + 1, j] + lever[1]) * dt,
        fz
        + (p[k + 2, j] * fx + p[k + 5, j] * fy + p[k + 8, j] * fz)
        + (p[_NABLA + 2, j] + lever[2]) * dt,
    )
    spread = spread_force(p, j, (wx, wy, wz), v, rate)
    return (wx, wy, wz), (v[0] + spread[0], v[1] + spread[1], v[2] + spread[2])


@inlined
def sense_in_ramp(p, inverse, j, angle, velocity, angle_noise, velocity_noise, dt, ramp):
    """Increments that imperfect sensors report of a step whose rate changes; see `sense`."""
    more = ramp_force(p, j, angle, velocity, dt, ramp)
    # compensation knows the force only without it: two rounds find that to rounding
    near = (velocity[0] - more[0], velocity[1] - more[1], velocity[2] - more[2])
    more = ramp_force(p, j, angle, near, dt, ramp)
    near = (velocity[0] - more[0], velocity[1] - more[1], velocity[2] - more[2])
    return sense(p, inverse, j, angle, near, angle_noise, velocity_noise, dt)


@inlined
def compensate_in_ramp(p, j, angle, velocity, dt, ramp):
    """Increments of a step whose rate changes, corrected: the inverse of `sense_in_ramp`."""
    w, v = compensate(p, j, angle, velocity, dt)
    more = ramp_force(p, j, w, v, dt, ramp)
    return w, (v[0] + more[0], v[1] + more[1], v[2] + more[2])
