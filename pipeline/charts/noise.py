"""The figure of a unit's noise: Allan deviations and what was found in them."""

from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure

from inscal.allan import NoiseFit
from pipeline.charts import style

_COLORS = ("#1f4e79", "#c23b22", "#3a7d44")


@style.styled
def allan(fits: Mapping[str, Sequence[NoiseFit]], units: Mapping[str, tuple[str, float]]) -> Figure:
    """Allan deviations with their intervals, and those of the noise found.

    Parameters
    ----------
    fits : mapping of str to sequence of NoiseFit
        Of a kind of sensor: x, y, z.
    units : mapping of str to (str, float)
        Unit of each: its name, and its size in SI.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = Figure(figsize=(9.0, 4.2))
    for axes, (sensor, three) in zip(figure.subplots(1, 2), fits.items(), strict=True):
        unit, size = units[sensor]
        for name, color, fit in zip("xyz", _COLORS, three, strict=True):
            axes.fill_between(
                fit.time, fit.lower / size, fit.upper / size, color=color, alpha=0.15, linewidth=0
            )
            axes.plot(fit.time, fit.deviation / size, "o", color=color, markersize=3, label=name)
            axes.plot(fit.time, fit.fitted / size, "-", color=color, linewidth=1.0)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("averaging time, s")
        axes.set_ylabel(f"Allan deviation, {unit}")
        axes.set_title({"gyro": "gyros", "accel": "accelerometers"}[sensor])
        axes.legend(fontsize=8.0)
    return figure
