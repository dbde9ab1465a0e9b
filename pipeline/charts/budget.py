"""The figures of an error budget: shares of the sources, their course in time, and effects."""

from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from inscal.parameters import UNITS
from pipeline.charts import style

_LARGEST = 8
_FAINT, _WRITTEN = 0.01, 0.1  # sigmas: white below, and a number from there on
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


@style.styled
def over_time(
    times: np.ndarray, variance: Mapping[str, np.ndarray], known: Sequence[str], place: int
) -> Figure:
    """Sigma of one parameter in the course of a calibration, and what it is made of.

    Parameters
    ----------
    times : ndarray, shape (n,)
        s.
    variance : mapping of str to ndarray, shape (n,)
        By source, in paper units squared; what is below zero is not drawn.
    known : sequence of str
        Sources that the filter knows, hatched.
    place : int
        Which parameter.

    Returns
    -------
    matplotlib.figure.Figure
    """
    parts, name = _parts(variance, known), style.label(place)
    total = np.sum(list(variance.values()), axis=0)
    formal = np.sum([variance[source] for source in known], axis=0)
    figure = Figure(figsize=(9.0, 7.0))
    sigma, stacked = figure.subplots(2, sharex=True, height_ratios=[1, 2])
    for values, text, look in ((total, "true", "-"), (formal, "formal", "--")):
        sigma.semilogy(times, np.sqrt(values), look, color=style.LIMIT_COLOR, label=text)
    sigma.set_ylabel(f"sigma, {UNITS[place]}")
    sigma.legend()
    drawn = sum(values for _, values, _, _ in parts)
    layers = stacked.stackplot(
        times,
        [100.0 * values / drawn for _, values, _, _ in parts],
        colors=[color for _, _, color, _ in parts],
        labels=[text for text, _, _, _ in parts],
        edgecolor="white",
        linewidth=0.3,
    )
    for layer, (_, _, _, hatch) in zip(layers, parts, strict=True):
        layer.set_hatch(hatch)
    stacked.set(xlim=(times[0], times[-1]), ylim=(0.0, 100.0))
    stacked.set(xlabel="time, s", ylabel="share of the true variance, %")
    figure.suptitle(f"What the error of {name} is made of (hatched: what the filter knows)")
    figure.legend(*stacked.get_legend_handles_labels(), loc="outside right center", fontsize=8.0)
    return figure


@style.styled
def mosaic(variance: Mapping[str, np.ndarray], formal: np.ndarray, known: Sequence[str]) -> Figure:
    """Effect of every source on every parameter, in sigmas that the filter claims.

    Parameters
    ----------
    variance : mapping of str to ndarray, shape (27,)
        By source.
    formal : ndarray, shape (27,)
        Sigma claimed, in the same units; zero of parameters that are not modelled.
    known : sequence of str
        Sources that the filter knows, at the left.

    Returns
    -------
    matplotlib.figure.Figure
    """
    claimed = np.where(formal > 0.0, formal, np.inf)
    effect = {name: np.sqrt(np.abs(v)) / claimed for name, v in variance.items()}
    unknown = [name for name in effect if name not in known]
    columns = [*known, *sorted(unknown, key=lambda name: -effect[name].max())]
    shown = np.array([effect[name][list(style.ORDER)] for name in columns]).T
    figure = Figure(figsize=(11.0, 8.5))
    axes = figure.subplots()
    image = axes.imshow(
        shown, cmap="magma_r", norm=LogNorm(_FAINT, 10.0, clip=True), aspect="auto"
    )  # fmt: skip
    for row, column in np.argwhere(shown >= _WRITTEN):
        value = shown[row, column]
        color = "white" if value > 1.0 else "black"
        axes.text(column, row, f"{value:.2g}", ha="center", va="center", size=5.5, color=color)
    axes.axvline(len(known) - 0.5, color=style.LIMIT_COLOR, linewidth=1.0)
    axes.set_yticks(range(len(style.ORDER)), [style.label(place) for place in style.ORDER])
    axes.set_xticks(range(len(columns)), columns, rotation=90)
    axes.tick_params(length=0)
    figure.colorbar(image, label="sigma of the source over the sigma that the filter claims")
    figure.suptitle(
        "What each source does to each parameter (left of the line: what the filter knows)"
    )
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
