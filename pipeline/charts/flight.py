"""The figure of a log navigated freely."""

from matplotlib.figure import Figure

from inscal.free_inertial import Flight
from pipeline.charts import style

_LINES = {"north": "#1f4e79", "east": "#c23b22"}


@style.styled
def errors(flight: Flight, names: tuple[str, str]) -> Figure:
    """Errors of a flight in its course.

    Parameters
    ----------
    flight : Flight
        Of two lanes.
    names : pair of str
        Of the lanes, such as without and with; scales are their own.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = Figure(figsize=(9.0, 5.0))
    rows = (flight.velocity, "velocity error, m/s"), (flight.position, "position error, m")
    for line, (values, label) in zip(figure.subplots(2, 2, sharex=True), rows, strict=True):
        for lane, (axes, name) in enumerate(zip(line, names, strict=True)):
            for place, (direction, color) in enumerate(_LINES.items()):
                axes.plot(flight.time, values[:, place, lane], color=color, label=direction)
            axes.axhline(0.0, color="#999999", linewidth=0.8)
            axes.set_ylabel(label)
            if values is flight.velocity:
                axes.set_title(f"{name} compensation")
            else:
                axes.set_xlabel("time, s")
    figure.axes[0].legend(fontsize=8.0)
    return figure
