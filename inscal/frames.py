r"""Estimates in the body frame of the accelerometers instead of the gyros'.

The project's body frame is the gyros': dKg is lower triangular, dKa is full. Others take the
accelerometers for the frame. What sensors report does not depend on that,

.. math:: w_{rep} = G w - b_g, \quad f_{rep} = A f - b_a - q \cdot f^2 - f_{arms} - d\, w \times f,

with the matrices that map true to reported, here in the gyros' frame, G = (I + dKg)^-1 and
A = (I + dKa)^-1. With the rotation R that makes :math:`A R^T` lower triangular the other frame has
the matrices :math:`G R^T` and :math:`A R^T`; biases b = (I + dK)^-1 times the project's, and
quadratic terms, belong to the sensors and stay. The arms of such a frame are those from the z
accelerometer, with the sign of the equation above: :math:`f_{arms} = \dot w \times r + w \times
(w \times r)`, which is what an accelerometer at -r reads beside one in the centre. d is the time by
which the accelerometers are ahead of the gyros.
"""

import numpy as np

from inscal.parameters import GROUPS, INDEX, NAMES
from inscal.sensor import matrices

_AXES = "xyz"
_GYRO = [f"gyro_k{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)]
_ACCEL = [f"accel_k{i}{j}" for i in (1, 2, 3) for j in range(1, i + 1)]
ARMS = ("x", "xy", "xz", "yx", "y", "yz", "zx", "zy", "z")
"""Ends of the names of nine components of arms, accelerometer by accelerometer."""
DELAY = "gyro_accel_delay"


def in_accelerometer_frame(values: dict[str, float]) -> dict[str, float]:
    """Estimates in the accelerometers' frame.

    Parameters
    ----------
    values : dict of str to float
        SI, by the names of the 27 parameters and of the augmented states of off-axis arms and of
        the delay, which may be missing.

    Returns
    -------
    dict of str to float
        Biases, ``gyro_k11`` to ``gyro_k33``, the lower triangle of ``accel_k``, quadratic terms;
        with off-axis arms the arms of the x and y accelerometers from the z accelerometer; and the
        delay, if there is one.
    """
    vector = np.array([values[name] for name in NAMES])
    gyro, accel = np.linalg.inv(np.eye(3) + matrices(vector[:, None])[:, 0])
    turned, upper = np.linalg.qr(accel.T)  # accel @ turned is lower triangular
    turned = turned * np.sign(np.diag(upper))
    out: dict[str, float] = {}
    for kind, matrix in (("gyro_bias", gyro), ("accel_bias", accel)):
        bias = matrix @ vector[INDEX[kind]]
        out |= {f"{kind}_{axis}": value for axis, value in zip(_AXES, bias, strict=True)}
    of_gyro, of_accel = gyro @ turned - np.eye(3), accel @ turned - np.eye(3)
    out |= dict(zip(_GYRO, of_gyro.ravel(), strict=True))
    out |= {name: float(of_accel[int(name[-2]) - 1, int(name[-1]) - 1]) for name in _ACCEL}
    out |= {f"accel_quadratic_{a}": values[f"accel_quadratic_{a}"] for a in _AXES}
    arms = [f"lever_arm_{end}" for end in ARMS]
    if all(name in values for name in arms):
        nine = np.array([values[name] for name in arms]).reshape(3, 3) @ turned
        from_z = nine[2] - nine
        out |= dict(zip(arms[:6], from_z[:2].ravel(), strict=True))
    if DELAY in values:
        out[DELAY] = -values[DELAY]
    return {name: float(value) for name, value in out.items()}


ACCELEROMETER_FRAME = (
    *(f"{kind}_{axis}" for kind in ("gyro_bias", "accel_bias") for axis in _AXES),
    *(*_GYRO, *_ACCEL, *(f"accel_quadratic_{axis}" for axis in _AXES)),
    *(f"lever_arm_{end}" for end in ARMS[:6]),
)
"""Names of what `in_accelerometer_frame` gives of the 27 parameters; arms are six."""


def in_gyro_frame(values: dict[str, float]) -> dict[str, float]:
    """Estimates in the accelerometers' frame as the 27 parameters: the way back.

    Parameters
    ----------
    values : dict of str to float
        SI, by `ACCELEROMETER_FRAME`.

    Returns
    -------
    dict of str to float
        By `inscal.parameters.NAMES`. An accelerometer's arm is the component along its own axis,
        which is all that there is if it has no other; the z accelerometer's is the mean of what
        both others say of it.
    """
    gyro = np.eye(3) + np.array([values[name] for name in _GYRO]).reshape(3, 3)
    accel = np.eye(3)
    for name in _ACCEL:
        accel[int(name[-2]) - 1, int(name[-1]) - 1] += values[name]
    turned, upper = np.linalg.qr(gyro.T)  # gyro @ turned is lower triangular
    turned = turned * np.sign(np.diag(upper))
    gyro, accel = gyro @ turned, accel @ turned
    out: dict[str, float] = {}
    for kind, reported in (("gyro", gyro), ("accel", accel)):
        inverse = np.linalg.inv(reported)
        bias = inverse @ [values[f"{kind}_bias_{axis}"] for axis in _AXES]
        out |= {f"{kind}_bias_{axis}": value for axis, value in zip(_AXES, bias, strict=True)}
        error = inverse - np.eye(3)
        out |= {n: error[int(n[-2]) - 1, int(n[-1]) - 1] for n in GROUPS[f"{kind}_k"]}
    out |= {f"accel_quadratic_{a}": values[f"accel_quadratic_{a}"] for a in _AXES}
    arms = np.array([values[f"lever_arm_{end}"] for end in ARMS[:6]]).reshape(2, 3) @ turned
    along = -arms[0, 0], -arms[1, 1], arms[:, 2].mean()
    out |= {f"lever_arm_{axis}": value for axis, value in zip(_AXES, along, strict=True)}
    return {name: float(out[name]) for name in NAMES}
