"""The figure of Table 2: ranks by several conventions beside the paper's."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from inscal.observability import STATES
from pipeline.charts import style

_MARKERS = "os^Dv"
_COLORS = ("#0072B2", "#E69F00", "#009E73", "#AA3377", "#D55E00")
_STEP = 0.14  # ranks by which lines that lie on each other are set apart


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
    axes.axhline(STATES, color=style.LIMIT_COLOR, linewidth=0.8, linestyle=":")
    axes.set_xticks(position)
    axes.set_yticks(range(12, STATES + 1, 3))
    axes.set_xlabel("position, the first being number 0 as in the paper")
    axes.set_ylabel("rank of the stripped observability matrix, default tolerance")
    axes.legend(loc="lower right")
    figure.suptitle(
        "The paper's Table 2 beside what each convention gives\n"
        "(lines set apart by fractions of a rank where they agree)"
    )
    return figure
