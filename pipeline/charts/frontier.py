"""The figure of time against accuracy: inherited schedules, designed ones, and campaigns."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from pipeline.charts import style

_LOOKS = (":", "--", "-")
_MARKERS = ("s", "D", "o")
_TICKS = (0.1, 0.5, 0.9, 0.99, 0.999)
_LEAST, _MOST = 0.02, 0.9997


@style.styled
def frontier(found: Mapping[str, Any]) -> Figure:
    """Share of runs that keep all bounds, and largest sigma over bound, against time.

    Parameters
    ----------
    found : mapping
        Of `pipeline.study.frontier.content`.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = Figure(figsize=(10.0, 5.4))
    left, right = figure.subplots(1, 2)
    _lines(left, found, "joint_share", _logit)
    _lines(right, found, "worst_sigma_over_bound", np.asarray)
    paths = _paths(found)
    for row in found["marked"]:
        middle, low, high = (_logit(row[f"joint_share{end}"]) for end in ("", "_lower", "_upper"))
        left.errorbar(
            row["total_time_s"], middle, yerr=[[middle - low], [high - middle]],
            color=style.NOISE_COLORS[row["noise"]], marker=_MARKERS[paths.index(row["path"])],
            markersize=5.0, markeredgecolor="black", markeredgewidth=0.6, capsize=2.0, zorder=3,
        )  # fmt: skip
    left.set_yticks([_logit(tick) for tick in _TICKS], [f"{100 * tick:g} %" for tick in _TICKS])
    left.set_ylim(_logit(_LEAST), _logit(_MOST))
    left.set_title("runs that keep all 27 bounds")
    right.set_yscale("log")
    right.axhline(1.0 / 3.0, color=style.LIMIT_COLOR, linewidth=0.6)
    right.set_title("largest sigma over bound (line: a third)")
    ticks = (0.1, 0.2, 0.3, 0.5, 1.0, 2.0)
    right.yaxis.set_major_locator(FixedLocator(ticks))
    right.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    right.yaxis.set_minor_locator(NullLocator())
    for axes in (left, right):
        _time_axis(axes)
    noises = dict.fromkeys(point["noise"] for point in found["points"])
    handles = [style.handle(f"noise: {n}", color=style.NOISE_COLORS[n]) for n in noises]
    handles += [
        style.handle(path, color=style.SCHEDULE_COLOR, linestyle=look, marker=marker)
        for path, look, marker in zip(paths, _LOOKS, _MARKERS, strict=True)
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    figure.suptitle("Accuracy against time (lines: predicted; marks: campaigns, 95 %)")
    return figure


def _paths(found: Mapping[str, Any]) -> list[str]:
    return list(dict.fromkeys(point["path"] for point in found["points"]))


def _logit(share: float) -> float:
    inside = np.clip(share, 1e-6, 1.0 - 1e-6)
    return float(np.log10(inside / (1.0 - inside)))


def _lines(axes: Axes, found: Mapping[str, Any], key: str, change: Any) -> None:
    for path, look in zip(_paths(found), _LOOKS, strict=True):
        for noise, color in style.NOISE_COLORS.items():
            own = [p for p in found["points"] if (p["path"], p["noise"]) == (path, noise)]
            own.sort(key=lambda point: point["total_time_s"])
            times = [point["total_time_s"] for point in own]
            values = [change(point[key]) for point in own]
            axes.plot(times, values, color=color, linestyle=look)


def _time_axis(axes: Axes) -> None:
    axes.set_xscale("log")
    ticks = [3600.0 * hours for hours in (0.25, 0.5, 1, 2, 3, 5, 8, 12, 24)]
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value / 3600:.2g} h"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlabel("duration of the calibration")
    axes.grid(color="#dddddd", linewidth=0.5)
