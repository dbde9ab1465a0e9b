"""Where ticks and labels of the page's charts go."""

from collections.abc import Sequence

import numpy as np

_STEP = 0.05  # between ratios near 1
_NEAR = 2.0  # range of ratios from which on round numbers of decades serve
_ROUND = (1.0, 2.0, 5.0)


def decades(smallest: float, largest: float) -> list[float]:
    """Up to three powers of ten between two sizes, for the ticks of a logarithmic axis."""
    low, high = int(np.ceil(np.log10(smallest))), int(np.floor(np.log10(largest)))
    step = max(1, -(-(high - low) // 2))
    return [float(f"1e{power}") for power in range(low, high + 1, step)]


def ratio_ticks(lowest: float, highest: float) -> list[float]:
    """Ticks of a logarithmic axis of ratios, few enough to be labelled all."""
    if highest < _NEAR * lowest:
        first, last = int(np.ceil(lowest / _STEP)), int(np.floor(highest / _STEP))
        step = max(1, (last - first) // 8)
        one = round(1.0 / _STEP)
        return [round(n * _STEP, 2) for n in range(first, last + 1) if (n - one) % step == 0]
    powers = range(int(np.floor(np.log10(lowest))), int(np.ceil(np.log10(highest))) + 1)
    ticks = [float(f"{digit:g}e{power}") for power in powers for digit in _ROUND]
    return [tick for tick in ticks if lowest <= tick <= highest]


def apart(values: Sequence[float], least: float) -> list[float]:
    """Move values apart, as little as that takes, until all differ by `least`.

    Parameters
    ----------
    values : sequence of float
    least : float

    Returns
    -------
    list of float
        In the order of `values`.
    """
    order = np.argsort(values, kind="stable")
    groups: list[list[float]] = []
    for value in np.asarray(values, dtype=float)[order]:
        groups.append([value])
        # a group stands around the mean of what is in it
        while len(groups) > 1 and _bottom(groups[-1], least) < _top(groups[-2], least) + least:
            last = groups.pop()
            groups[-1] += last
    placed = [_bottom(group, least) + n * least for group in groups for n in range(len(group))]
    out = np.empty(len(placed))
    out[order] = placed
    return out.tolist()


def _bottom(group: Sequence[float], least: float) -> float:
    return float(np.mean(group)) - least * (len(group) - 1) / 2.0


def _top(group: Sequence[float], least: float) -> float:
    return float(np.mean(group)) + least * (len(group) - 1) / 2.0
