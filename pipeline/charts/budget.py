"""The figure of an error budget: what share of each parameter's variance every source has."""

from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from pipeline.charts import style

_LARGEST = 8
_REST_COLOR = "#cccccc"
# pastel for what the filter knows, strong for what it does not: light and dark in print
_KNOWN = ("#b3cde3", "#ccebc5", "#decbe4", "#fed9a6", "#e5d8bd")


@style.styled
def contributions(variance: Mapping[str, np.ndarray], known: Sequence[str]) -> Figure:
    """Stacked shares of the true variance of every parameter.

    Parameters
    ----------
    variance : mapping of str to ndarray, shape (27,)
        By source; what is below zero is not drawn.
    known : sequence of str
        Sources that the filter knows, hatched.

    Returns
    -------
    matplotlib.figure.Figure
    """
    parts = _parts(variance, known)
    total = sum(values for _, values, _, _ in parts)
    figure = Figure(figsize=(9.0, 8.0))
    axes = figure.subplots()
    style.draw_rows(axes)
    rows, left = style.row_positions(), np.zeros(len(style.ORDER))
    for name, values, color, hatch in parts:
        share = np.divide(values, total, out=np.zeros_like(total), where=total > 0.0)
        width = 100.0 * share[list(style.ORDER)]
        axes.barh(
            rows, width, left=left, color=color, hatch=hatch, edgecolor="white",
            linewidth=0.3, height=0.8, label=name,
        )  # fmt: skip
        left += width
    axes.set_xlim(0.0, 100.0)
    axes.set_xlabel("share of the true variance, %")
    figure.suptitle("What every error is made of (hatched: what the filter knows)")
    figure.legend(loc="outside right upper", fontsize=8.0)
    return figure


def _parts(
    variance: Mapping[str, np.ndarray], known: Sequence[str]
) -> list[tuple[str, np.ndarray, object, str]]:
    """Name, values, colour and hatch of what is drawn: the largest sources, and the rest as one."""
    positive = {name: np.maximum(values, 0.0) for name, values in variance.items()}
    total = sum(positive.values())
    weight = {
        name: float(np.divide(v, total, out=np.zeros_like(total), where=total > 0.0).sum())
        for name, v in positive.items()
    }
    ordered = sorted(positive, key=lambda name: -weight[name])
    inside = [name for name in ordered if name in known][: len(_KNOWN)]
    outside = [name for name in ordered if name not in known and weight[name] > 0.0][:_LARGEST]
    parts: list[tuple[str, np.ndarray, object, str]] = [
        (name, positive[name], color, "////")
        for name, color in zip(inside, _KNOWN[: len(inside)], strict=True)
    ]
    parts += [
        (name, positive[name], color, "")
        for name, color in zip(outside, mpl.colormaps["tab10"](range(len(outside))), strict=True)
    ]
    rest = [name for name in ordered if name not in (*inside, *outside)]
    if rest:
        others = np.sum([positive[name] for name in rest], axis=0)
        parts.append(("all others", others, _REST_COLOR, ""))
    return parts
