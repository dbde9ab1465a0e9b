"""The figures of observability: sigma by position, and ranks beside the paper's."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from inscal.parameters import KIND_OF
from pipeline.charts import style

_MARKERS = "os^Dv"
_COLORS = ("#0072B2", "#E69F00", "#009E73", "#AA3377", "#D55E00")
_STEP = 0.14  # ranks by which lines that lie on each other are set apart


@style.styled
def sigma_heat_map(share: np.ndarray, setup: str) -> Figure:
    """Sigma of every parameter after every position, over its initial sigma.

    Parameters
    ----------
    share : ndarray, shape (positions, 27)
        Zero where the filter does not model the parameter.
    setup : str
        What it was computed for.

    Returns
    -------
    Figure
    """
    order = list(style.ORDER)
    values = np.ma.masked_less_equal(share.T[order], 0.0)
    figure = Figure(figsize=(11, 7.5))
    axes = figure.subplots()
    image = axes.imshow(
        values, aspect="auto", cmap="viridis", norm=LogNorm(min(1e-3, values.min()), 1.0)
    )
    axes.set_yticks(range(len(order)), [style.label(index) for index in order])
    axes.set_xticks(range(len(share)), [str(n) for n in range(1, len(share) + 1)])
    axes.tick_params(length=0)
    kinds = [KIND_OF[index] for index in order]
    for row in range(1, len(kinds)):
        if kinds[row] != kinds[row - 1]:
            axes.axhline(row - 0.5, color="white", linewidth=2)
    axes.set_xlabel("after position")
    bar = figure.colorbar(image, ax=axes, pad=0.01)
    bar.set_label("sigma / initial sigma (log scale)")
    figure.suptitle(f"When a path makes its parameters known: {setup}")
    return figure


@style.styled
def rank_figure(paper: Sequence[int], conventions: Mapping[str, np.ndarray]) -> Figure:
    """Rank after each position by several conventions, beside the paper's.

    Parameters
    ----------
    paper : sequence of int
        By position, the first being number 0 as in the paper.
    conventions : mapping of str to ndarray, shape (positions,)

    Returns
    -------
    Figure
    """
    figure = Figure(figsize=(10, 6))
    axes = figure.subplots()
    position = np.arange(len(paper))
    axes.plot(position, paper, color="#bbbbbb", linewidth=9, label="the paper", zorder=1)
    for number, (name, rank) in enumerate(conventions.items()):
        axes.plot(
            position,
            rank + _STEP * (number - (len(conventions) - 1) / 2),
            marker=_MARKERS[number],
            color=_COLORS[number],
            markersize=5,
            linewidth=1,
            label=name,
        )
    axes.axhline(36, color=style.LIMIT_COLOR, linewidth=0.8, linestyle=":")
    axes.set_xticks(position)
    axes.set_yticks(range(12, 37, 3))
    axes.set_xlabel("position, the first being number 0 as in the paper")
    axes.set_ylabel("rank of the stripped observability matrix, default tolerance")
    axes.legend(loc="lower right")
    figure.suptitle(
        "The paper's Table 2 beside what each convention gives\n"
        "(lines set apart by fractions of a rank where they agree)"
    )
    return figure
