"""The figure of observability: sigma by position."""

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from inscal.parameters import KIND_OF
from pipeline.charts import style


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
