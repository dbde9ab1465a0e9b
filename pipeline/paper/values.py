"""What the paper prints: the numbers this reproduction is held against, as data.

Keyed by parameter kind, in the paper units of `inscal.parameters.KINDS`, each kind in state order
(accelerometer installation: k21 k31 k12 k32 k13 k23). Truth and bounds of Table 3 are
configuration (``conf/truth/paper.yaml``, ``conf/bounds/paper.yaml``); what only the paper's own
experiment gave is here.
"""

from collections.abc import Sequence
from dataclasses import dataclass

KindTable = dict[str, float | Sequence[float]]

TABLE_3_ESTIMATES: KindTable = {
    "gyro_bias": (0.04996, 0.05001, 0.04923),
    "gyro_scale_factor": (500.34, 502.41, 501.69),
    "gyro_installation": (206.29, 206.74, 207.07),
    "accel_bias": (205.29, 199.06, 191.24),
    "accel_scale_factor": (501.18, 498.95, 499.68),
    "accel_installation": (206.86, 206.88, 208.84, 206.24, 207.04, 209.00),
    "accel_quadratic": (29.706, 30.083, 30.354),
    "lever_arm": (10.07, 18.65, 27.15),
}
"""Estimates of the one simulated run of the paper's section 6."""

VIBRATION_VELOCITY_ERROR = 2.5
"""Largest north velocity error by the quadratic terms, m/s (Fig. 1)."""

SWING_VELOCITY_ERROR = 3.0
"""Largest north velocity error by the inner lever arm, m/s (Fig. 2)."""

QUADRATIC_SETTLED_S = 5000.0
"""When the errors of the quadratic terms have settled, s (Fig. 3)."""

LEVER_ARM_SETTLES_WITHIN_LAST_S = 3000.0
"""The stretch at the end in which the errors of the lever arm settle, s (Fig. 4)."""

NAVIGATION_VELOCITY_ERROR = 0.5
"""Bound of the velocity error of the compensated path, m/s (Figs. 5 to 8)."""

NAVIGATION_POSITION_ERROR_NMI = 0.005
"""Bound of its position error as printed, nautical miles."""


@dataclass(frozen=True)
class LaboratoryCalibration:
    """One column of Table 4.

    Attributes
    ----------
    date : str
    values : KindTable
        All kinds but the two scale factors.
    gyro_scale_ppm : tuple of 3 float
        Relative to a nominal scale that the paper does not state.
    accel_pulses : tuple of 3 float
        Accelerometer scale factors, read as pulses per m/s.
    """

    date: str
    values: KindTable
    gyro_scale_ppm: tuple[float, float, float]
    accel_pulses: tuple[float, float, float]


TABLE_4: tuple[LaboratoryCalibration, LaboratoryCalibration] = (
    LaboratoryCalibration(
        date="2014-01-21",
        values={
            "gyro_bias": (0.0017, -0.0103, -0.0362),
            "gyro_installation": (197.12, 131.08, -117.52),
            "accel_bias": (1243.56, -517.83, 8.69),
            "accel_installation": (-638.33, 333.87, 953.39, -156.20, 115.38, 84.01),
            "accel_quadratic": (3.5037, 2.7622, 2.2385),
            "lever_arm": (28.6, 24.1, -10.8),
        },
        gyro_scale_ppm=(442403.3, 442264.4, 442275.9),
        accel_pulses=(1673.84, 1669.62, 1715.26),
    ),
    LaboratoryCalibration(
        date="2014-03-04",
        values={
            "gyro_bias": (0.0016, -0.0101, -0.0361),
            "gyro_installation": (194.86, 131.65, -118.59),
            "accel_bias": (1240.21, -527.02, 38.14),
            "accel_installation": (-637.78, 333.46, 956.80, -157.13, 114.65, 84.40),
            "accel_quadratic": (3.1055, 3.0762, 2.2309),
            "lever_arm": (27.2, 22.2, -10.7),
        },
        gyro_scale_ppm=(442403.4, 442264.3, 442275.5),
        accel_pulses=(1673.84, 1669.54, 1715.23),
    ),
)
"""The laboratory's two calibrations of one unit."""
