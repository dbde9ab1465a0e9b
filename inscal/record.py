"""What a laboratory records of a calibration: all that an estimator may see of the truth."""

from dataclasses import dataclass

import numpy as np

OBSERVED = 6
"""Observed quantities: velocity and position, three components each."""


@dataclass(frozen=True)
class Record:
    """Records of `inscal.kernel.LANES` calibrations, side by side in the last axis.

    Attributes
    ----------
    sensors : ndarray, shape (steps, 6, LANES)
        Reported angle (rad) and velocity increments (m/s), body axes.
    observations : ndarray, shape (updates, OBSERVED, LANES)
        Observed velocity North, East, Down (m/s) and position offset from the site, metres north,
        east and of height.
    attitude : ndarray, shape (3, 3, LANES)
        Body-to-NED matrix as assumed at the start (aligned with errors).
    velocity, position : ndarray, shape (3, LANES)
        As assumed at the start, in the units of the observations.
    """

    sensors: np.ndarray
    observations: np.ndarray
    attitude: np.ndarray
    velocity: np.ndarray
    position: np.ndarray
