"""What every reader gives."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Rows:
    """A log as it is in its file.

    Attributes
    ----------
    time : ndarray, shape (rows,)
        s.
    gyro, accel : ndarray, shape (rows, 3)
        In the file's axes and numbers.
    observed : ndarray, shape (rows, 6), or None
        m/s and m.
    """

    time: np.ndarray
    gyro: np.ndarray
    accel: np.ndarray
    observed: np.ndarray | None = None
