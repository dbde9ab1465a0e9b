"""The figure of what leaving out states costs."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.charts import style
from pipeline.paper.ablation import MODELS, Ablation, Reduced

_LOOKS = {
    "states33_quadratic": ("#0072B2", "o"),
    "states33_lever_arm": ("#E69F00", "s"),
    "states30": ("#AA3377", "^"),
}
_SPACING = 0.27


@style.styled
def ablation_figure(ablations: Mapping[str, Ablation]) -> Figure:
    """RMSE of each filter over that of the full one, by parameter; a panel for each truth.

    Parameters
    ----------
    ablations : mapping of str to Ablation
        By truth.

    Returns
    -------
    Figure
    """
    figure = Figure(figsize=(15, 11))
    panels = figure.subplots(1, len(ablations), sharex=True, sharey=True, squeeze=False)[0]
    for axes, (truth, ablation) in zip(panels, ablations.items(), strict=True):
        axes.set_xscale("log")
        style.draw_rows(axes)
        for number, (end, (color, marker)) in enumerate(_LOOKS.items()):
            offset = _SPACING * (number - (len(_LOOKS) - 1) / 2)
            _draw(axes, ablation.reduced[end], offset, color, marker)
        axes.axvline(1.0, color=style.LIMIT_COLOR, linewidth=1.2)
        axes.set_title(truth)
        axes.set_xlabel("RMSE / RMSE of the 36-state filter (log scale)")
        axes.xaxis.set_major_formatter(style.plain_numbers())
        # intervals of a few runs that decide everything are wider than any axis
        axes.set_xlim(0.2, 5000.0)
    figure.suptitle("What it costs to leave states out of the filter")
    figure.legend(handles=_handles(), loc="outside lower center", ncols=3)
    return figure


def _draw(axes: Axes, reduced: Reduced, offset: float, color: str, marker: str) -> None:
    order = list(style.ORDER)
    rows = np.array(style.row_positions()) + offset
    low, ratio, high = (
        reduced.comparison[key].to_numpy()[order]
        for key in ("simultaneous_lower", "ratio", "simultaneous_upper")
    )
    modelled = reduced.modelled[order]
    axes.hlines(rows, low, high, color=color, linewidth=1.0)
    axes.plot(ratio[modelled], rows[modelled], marker, color=color, markersize=4)
    axes.plot(
        ratio[~modelled],
        rows[~modelled],
        marker,
        color=color,
        markersize=5,
        markerfacecolor="white",
    )
    if reduced.one_run_decides:
        axes.plot(reduced.median.ratio[order], rows, "|", color="black", markersize=7)


def _handles():
    out = [
        style.handle(MODELS[end], color=color, marker=marker, markersize=5)
        for end, (color, marker) in _LOOKS.items()
    ]
    plain = {"color": style.LIMIT_COLOR, "linestyle": "none"}
    return [
        *out,
        style.handle(
            "not a state of that filter", marker="o", markerfacecolor="white", markersize=5, **plain
        ),
        style.handle("line: 95 %, for all at once", color=style.LIMIT_COLOR, linewidth=1),
        style.handle(
            "median |error| instead, where one run decides the RMSE",
            marker="|",
            markersize=7,
            **plain,
        ),
    ]
