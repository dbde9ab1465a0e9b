"""The 27 sensor error parameters: names, groups, kinds and paper units.

The order is that of the paper's state vector (eq. 7). Every 27-vector of this library, in SI,
follows it; so does the ``parameter`` dimension of every store.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from inscal import units

_AXES = ("x", "y", "z")

GROUPS: dict[str, tuple[str, ...]] = {
    "gyro_bias": tuple(f"gyro_bias_{a}" for a in _AXES),
    "accel_bias": tuple(f"accel_bias_{a}" for a in _AXES),
    "gyro_k": tuple(f"gyro_k{ij}" for ij in ("11", "21", "31", "22", "32", "33")),
    "accel_k": tuple(
        f"accel_k{ij}" for ij in ("11", "21", "31", "12", "22", "32", "13", "23", "33")
    ),
    "accel_quadratic": tuple(f"accel_quadratic_{a}" for a in _AXES),
    "lever_arm": tuple(f"lever_arm_{a}" for a in _AXES),
}
"""Parameter names by group, groups and names in state order."""

NAMES: tuple[str, ...] = tuple(name for names in GROUPS.values() for name in names)
"""The 27 names in state order."""

COUNT = len(NAMES)

INDEX: dict[str, slice] = {}
"""Slice of each group in a 27-vector."""
for _group, _names in GROUPS.items():
    _start = NAMES.index(_names[0])
    INDEX[_group] = slice(_start, _start + len(_names))


@dataclass(frozen=True)
class Augmentation:
    """States beyond the 27 that a filter may have, for what else the truth may hold.

    Attributes
    ----------
    source : str
        Member of `inscal.disturbance.SOURCES`, whose effect on a record they have.
    names : tuple of str
        Of the states: the source's constants in their order, or its terms on each axis.
    """

    source: str
    names: tuple[str, ...]

    @property
    def wanders(self) -> bool:
        """Whether the states move: Gauss-Markov biases beside the constant ones."""
        return self.source.endswith("_wander")

    @property
    def drifts(self) -> bool:
        """Whether what a state does depends on the time since the start."""
        return self.source.endswith("_drift")


def _axial(name: str) -> Augmentation:
    return Augmentation(name, tuple(f"{name}_{a}" for a in _AXES))


def _crossed(source: str, name: str) -> Augmentation:
    return Augmentation(source, tuple(f"{name}_{a}{b}" for a in _AXES for b in _AXES if a != b))


AUGMENTATIONS: dict[str, Augmentation] = {
    "off_axis_lever_arm": _crossed("off_axis_lever_arm", "lever_arm"),
    "table_offset": _axial("table_offset"),
    "gyro_accel_delay": Augmentation("gyro_accel_delay", ("gyro_accel_delay",)),
    "accel_cubic": _axial("accel_cubic"),
    "accel_asymmetry": _axial("accel_asymmetry"),
    "accel_cross": _crossed("accel_cross_coupling", "accel_cross"),
    "accel_pendulous": _crossed("accel_pendulous", "accel_pendulous"),
    "gyro_asymmetry": _axial("gyro_asymmetry"),
    "gyro_g_sensitivity": Augmentation(
        "gyro_g_sensitivity", tuple(f"gyro_g_sensitivity_{a}{b}" for a in _AXES for b in _AXES)
    ),
    "gyro_drift": _axial("gyro_drift"),
    "accel_drift": _axial("accel_drift"),
    "gyro_scale_drift": _axial("gyro_scale_drift"),
    "accel_scale_drift": _axial("accel_scale_drift"),
    "gravity": Augmentation("gravity", ("gravity",)),
    "latitude": Augmentation("latitude", ("latitude",)),
    "deflection": Augmentation("deflection", ("deflection_north", "deflection_east")),
    "gyro_wander": _axial("gyro_wander"),
    "accel_wander": _axial("accel_wander"),
}
"""Groups of augmented states by name, in state order, those that wander last.

``lever_arm_xy`` is the y component of the x accelerometer's arm, ``accel_cross_xy`` what f_x f_y
and ``accel_pendulous_xy`` what f_y^2 does to the x accelerometer, ``gyro_g_sensitivity_xy`` what
f_y does to the x gyro.
"""


@dataclass(frozen=True)
class Kind:
    """What a table speaks of: parameters of one physical kind share a unit.

    Attributes
    ----------
    unit : str
        Paper unit, as printed.
    unit_si : float
        Size of that unit in SI; for the quadratic term at the pulse scale of 1 (see `si_units`).
    """

    unit: str
    unit_si: float


KINDS: dict[str, Kind] = {
    "gyro_bias": Kind("deg/h", units.DEG_PER_HOUR),
    "accel_bias": Kind("ug", units.MICRO_G),
    "gyro_scale_factor": Kind("ppm", units.PPM),
    "gyro_installation": Kind("arcsec", units.ARCSEC),
    "accel_scale_factor": Kind("ppm", units.PPM),
    "accel_installation": Kind("arcsec", units.ARCSEC),
    "accel_quadratic": Kind("1e-9", units.QUADRATIC_SI_FACE_VALUE),
    "lever_arm": Kind("mm", units.MILLIMETRE),
}
"""The kinds of the paper's Table 3."""


def kind_of(name: str) -> str:
    """Kind (key of `KINDS`) of a parameter name.

    Raises
    ------
    KeyError
        If `name` is not one of `NAMES`.
    """
    if name not in NAMES:
        raise KeyError(name)
    group = next(g for g, names in GROUPS.items() if name in names)
    if group in ("gyro_k", "accel_k"):
        sensor, row, column = group[:-2], name[-2], name[-1]
        return f"{sensor}_scale_factor" if row == column else f"{sensor}_installation"
    return group


KIND_OF: tuple[str, ...] = tuple(kind_of(name) for name in NAMES)
"""Kind of each of the 27 parameters, in state order."""

UNITS: tuple[str, ...] = tuple(KINDS[kind].unit for kind in KIND_OF)
"""Paper unit of each of the 27 parameters, in state order."""


def members(kind: str) -> np.ndarray:
    """Indices in a 27-vector of the parameters of a kind, in state order.

    Raises
    ------
    KeyError
        If `kind` is not a key of `KINDS`.
    """
    if kind not in KINDS:
        raise KeyError(kind)
    return np.flatnonzero(np.array(KIND_OF) == kind)


def si_units(quadratic_unit: float) -> np.ndarray:
    """Size in SI of the paper unit of each parameter.

    Parameters
    ----------
    quadratic_unit : float
        Size of 1e-9 of quadratic coefficient in s^2/m: `units.quadratic_unit` of the pulse scale,
        or `units.QUADRATIC_SI_FACE_VALUE`.

    Returns
    -------
    ndarray, shape (27,)
        Multiply a value in paper units by this to have it in SI.
    """
    sizes = np.array([KINDS[kind].unit_si for kind in KIND_OF])
    sizes[INDEX["accel_quadratic"]] = quadratic_unit
    return sizes


def vector(values: Mapping[str, float | Sequence[float]]) -> np.ndarray:
    """27-vector from one value, or one per parameter, of each kind.

    Parameters
    ----------
    values : mapping of str to float or sequence of float
        One entry per kind of `KINDS`: a number for all parameters of the kind, or one number for
        each of them in state order.

    Returns
    -------
    ndarray, shape (27,)
        The values in state order, in the unit they were given in.

    Raises
    ------
    ValueError
        If a kind is missing or unknown, or a sequence has the wrong length.
    """
    if set(values) != set(KINDS):
        odd = sorted(set(values) ^ set(KINDS))
        raise ValueError(f"parameter kinds {odd} are missing or unknown; allowed {sorted(KINDS)}")
    out = np.empty(COUNT)
    for kind, value in values.items():
        own = members(kind)
        entries = np.atleast_1d(np.asarray(value, dtype=float))
        if entries.shape not in ((1,), (len(own),)):
            raise ValueError(f"{kind} takes one number or {len(own)}, not {entries.size}")
        out[own] = entries
    return out
