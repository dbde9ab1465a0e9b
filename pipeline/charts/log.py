"""The figure of a calibrated log: innovations over what is expected, and forces at rest."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from pipeline.charts import style

_COLOR, _LEFT_OUT = "#1f4e79", "#c23b22"


@style.styled
def residuals(
    ratio: np.ndarray,
    limits: tuple[np.ndarray, np.ndarray],
    force: np.ndarray,
    unit: str,
    left_out: Sequence[int],
) -> Figure:
    """Residuals of a log, rest by rest.

    Parameters
    ----------
    ratio : ndarray, shape (rests,)
        Innovations squared over what is expected of them; NaN where nothing is judged.
    limits : pair of ndarray, shape (rests,)
        Between which 95 % of them lie if the filter is right.
    force : ndarray, shape (rests,)
        Length of the compensated specific force less gravity.
    unit : str
        Of it.
    left_out : sequence of int
        Rests in which nothing was observed, from 0.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = Figure(figsize=(8.0, 5.0))
    upper, lower = figure.subplots(2, 1, sharex=True)
    number = np.arange(1, len(force) + 1)
    upper.fill_between(number, *limits, color="#dddddd", step="mid", label="95 % if it is right")
    upper.plot(number, ratio, "o", color=_COLOR, markersize=4)
    upper.set_ylabel("innovations squared\nover expected")
    upper.legend(loc="upper right", fontsize=8.0)
    lower.axhline(0.0, color="#999999", linewidth=0.8)
    is_out = np.isin(number - 1, left_out)
    lower.plot(number[~is_out], force[~is_out], "o", color=_COLOR, markersize=4, label="observed")
    if is_out.any():
        lower.plot(
            number[is_out], force[is_out], "s", color=_LEFT_OUT, markersize=5, label="left out"
        )
        lower.legend(loc="upper right", fontsize=8.0)
    lower.set_ylabel(f"specific force\nless gravity, {unit}")
    lower.set_xlabel("rest")
    return figure
