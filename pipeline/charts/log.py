"""The figure of a calibrated log: innovations over what is expected, and forces at rest."""

import numpy as np
from matplotlib.figure import Figure

from inscal.chance import chi_square_limits
from inscal.units import MICRO_G
from pipeline.charts import style
from pipeline.logs.calibration import Calibrated
from pipeline.logs.evidence import Evidence
from pipeline.logs.result import force_less_gravity

_COLOR, _LEFT_OUT = "#1f4e79", "#c23b22"
_SMALL = 1e-3  # m/s^2: below it forces are in ug


@style.styled
def residuals(found: Calibrated, evidence: Evidence, left_out: list[int]) -> Figure:
    """Residuals of a log, rest by rest.

    Parameters
    ----------
    found : Calibrated
    evidence : Evidence
    left_out : list of int
        Rests in which nothing was observed, from 1.

    Returns
    -------
    matplotlib.figure.Figure
        Innovations squared over what is expected of them, with the interval that holds 95 % if the
        filter is right; and the length of the compensated specific force less gravity.
    """
    figure = Figure(figsize=(8.0, 5.0))
    upper, lower = figure.subplots(2, 1, sharex=True)
    rests = {int(one.name): one for one in evidence.tests if one.kind == "position"}
    limits = np.array([chi_square_limits(one.dof) for one in rests.values()]).reshape(-1, 2)
    grey = {"color": "#d0d0d0", "linewidth": 7.0, "label": "95 % if it is right"}
    upper.vlines(list(rests), *limits.T, **grey)
    ratio = [one.chi_square / one.dof for one in rests.values()]
    upper.plot(list(rests), ratio, "o", color=_COLOR, markersize=4)
    upper.set_ylabel("innovations squared\nover expected")
    upper.legend(loc="upper right", fontsize=8.0)
    force = force_less_gravity(found)
    unit, size = ("ug", MICRO_G) if np.abs(force).max() < _SMALL else ("m/s$^2$", 1.0)
    lower.axhline(0.0, color="#999999", linewidth=0.8)
    number = np.arange(1, len(force) + 1)
    is_out = np.isin(number, left_out)
    lower.plot(number[~is_out], force[~is_out] / size, "o", color=_COLOR, markersize=4)
    if is_out.any():
        look = {"color": _LEFT_OUT, "markersize": 5, "label": "left out"}
        lower.plot(number[is_out], force[is_out] / size, "s", **look)
        lower.legend(loc="upper right", fontsize=8.0)
    lower.set_ylabel(f"specific force\nless gravity, {unit}")
    lower.set_xlabel("rest")
    return figure
