"""The figures of campaigns and comparisons.

Each takes what it draws and gives back a figure to save; no file is read or written here.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from inscal.parameters import COUNT, KIND_OF, KINDS, NAMES, members
from pipeline.charts import density, style
from pipeline.study import honesty
from pipeline.study.campaign import Campaign

_SPACING = 0.25  # rows between two campaigns drawn in one row
_BELOW = 0.3  # rows from a ratio down to its prediction
_BINS = 30
_FILL = 0.45  # opacity of histograms
_NEES_VIEW = 8  # NEES histograms end at this many degrees of freedom


@style.styled
def errors_against_bounds(campaigns: Mapping[str, Campaign]) -> Figure:
    """|error| over bound of every parameter: median, 95 % and 99.7 % points.

    Parameters
    ----------
    campaigns : mapping of str to Campaign
        By noise level.

    Returns
    -------
    Figure
    """
    figure = Figure(figsize=(10, 12))
    axes = figure.subplots()
    axes.set_xscale("log")
    first = next(iter(campaigns.values()))
    style.draw_rows(axes, _bound_texts(first))
    for number, (noise, campaign) in enumerate(campaigns.items()):
        offset = _SPACING * (number - (len(campaigns) - 1) / 2)
        _draw_quantiles(axes, campaign, offset, style.NOISE_COLORS[noise])
    axes.axvline(1.0, color=style.LIMIT_COLOR, linewidth=1.2)
    _, right = axes.get_xlim()
    axes.axvspan(1.0, right, facecolor="none", edgecolor="#bbbbbb", hatch="//", linewidth=0)
    axes.set_xlim(right=right)
    axes.xaxis.set_major_formatter(style.plain_numbers())
    axes.set_xlabel("|error| / bound (log scale); hatched: bound missed")
    figure.suptitle(
        "How far errors are from the paper's bounds\n"
        f"{_setup_text(first)}, {_runs_text(campaigns.values())} for each noise level"
    )
    figure.legend(
        handles=[*_noise_handles(campaigns), *_quantile_handles()],
        loc="outside lower center",
        ncols=2,
    )
    return figure


def _bound_texts(campaign: Campaign) -> list[str]:
    bound = campaign.table["bound"].to_numpy()
    texts = []
    for kind in KINDS:
        own = sorted({f"{b:g}" for b in bound[members(kind)]})
        texts.append(f"bound {', '.join(own)} {style.unit_text(kind, campaign.quadratic_unit)}")
    return texts


def _draw_quantiles(axes: Axes, campaign: Campaign, offset: float, color: str) -> None:
    order = list(style.ORDER)
    bound = campaign.table["bound"].to_numpy()
    median = np.median(np.abs(campaign.error), axis=0)
    points = [median, *(campaign.table[f"abs_error_{p}"].to_numpy() for p in ("p95", "p997"))]
    low, middle, high = ((point / bound)[order] for point in points)
    rows = np.array(style.row_positions()) + offset
    axes.hlines(rows, low, high, color=color, linewidth=1.2)
    axes.plot(low, rows, "o", color=color, markersize=4, markerfacecolor="white")
    axes.plot(middle, rows, "o", color=color, markersize=4)
    axes.plot(high, rows, "|", color=color, markersize=6, markeredgewidth=1.6)


def _noise_handles(campaigns: Mapping[str, Campaign]) -> list[Line2D]:
    return [
        style.handle(
            f"{noise}: {style.noise_text(campaign.configuration['noise'])}",
            color=style.NOISE_COLORS[noise],
            linewidth=3,
        )
        for noise, campaign in campaigns.items()
    ]


def _quantile_handles() -> list[Line2D]:
    point = {"color": style.LIMIT_COLOR, "linestyle": "none"}
    return [
        style.handle(
            "median of |error|", marker="o", markerfacecolor="white", markersize=5, **point
        ),
        style.handle("95 % of runs are below", marker="o", markersize=5, **point),
        style.handle("99.7 % of runs are below", marker="|", markersize=8, **point),
    ]


@style.styled
def error_distributions(campaign: Campaign) -> Figure:
    """Histogram of each parameter's errors, with the normal curve of the filter's own sigma.

    Parameters
    ----------
    campaign : Campaign

    Returns
    -------
    Figure
    """
    figure = Figure(figsize=(10, 15))
    panels = figure.subplots(9, 3).flat
    color = style.PASS_COLORS[campaign.passes]
    for axes, index in zip(panels, style.ORDER, strict=True):
        _draw_distribution(axes, campaign, index)
    noise = campaign.configuration["noise"]
    figure.suptitle(
        f"Estimation errors of {_runs_text([campaign])}: {_setup_text(campaign)}\n"
        f"{noise['name']} noise: {style.noise_text(noise)}\n"
        "across: estimate minus truth in the unit of the panel; up: density"
    )
    figure.legend(
        handles=[
            style.handle("errors", color=color, linewidth=6, alpha=_FILL),
            style.handle("normal curve of the filter's own sigma", color=style.PREDICTION_COLOR),
            style.handle("bound, where in view", color=style.LIMIT_COLOR, linestyle="--"),
        ],
        loc="outside lower center",
        ncols=3,
    )
    return figure


def _draw_distribution(axes: Axes, campaign: Campaign, index: int) -> None:
    error = campaign.error[:, index]
    sigma = float(campaign.table["predicted_std"][index])
    bound = float(campaign.table["bound"][index])
    view = 1.05 * max(np.abs(error).max(), 4.0 * sigma)
    edges = np.linspace(-view, view, _BINS + 1)
    axes.hist(
        error, edges.tolist(), density=True, color=style.PASS_COLORS[campaign.passes], alpha=_FILL
    )
    if sigma > 0.0:
        x = np.linspace(-view, view, 201)
        axes.plot(x, density.normal(x, sigma), color=style.PREDICTION_COLOR)
    if bound < view:
        for end in (-bound, bound):
            axes.axvline(end, color=style.LIMIT_COLOR, linestyle="--", linewidth=1.2)
    unit = style.unit_text(KIND_OF[index], campaign.quadratic_unit)
    beyond = 100.0 * (np.abs(error) > bound).mean()
    axes.set_title(
        f"{style.label(index)} [{unit}]\nbound ±{bound:g}: {beyond:.1f} % of runs beyond",
        fontsize=8.5,
    )
    axes.set_xlim(-view, view)
    axes.locator_params(axis="x", nbins=5)
    axes.set_yticks([])
    axes.spines.left.set_visible(False)


@style.styled
def predicted_against_empirical(campaigns: Mapping[int, Campaign]) -> Figure:
    """RMSE over the filter's own sigma of every parameter, with 95 % intervals.

    Parameters
    ----------
    campaigns : mapping of int to Campaign
        By number of passes.

    Returns
    -------
    Figure
    """
    figure = Figure(figsize=(10, 10))
    axes = figure.subplots()
    axes.set_xscale("log")
    style.draw_rows(axes)
    for number, (passes, campaign) in enumerate(campaigns.items()):
        offset = _SPACING * (number - (len(campaigns) - 1) / 2)
        _draw_ratios(axes, campaign, offset, passes)
    runs = min(campaign.summary["runs_done"] for campaign in campaigns.values())
    low, high = honesty.ratio_limits(runs, COUNT)
    axes.axvspan(low, high, color="#999999", alpha=0.35, linewidth=0)
    axes.axvline(1.0, color=style.LIMIT_COLOR, linewidth=1)
    style.log_ticks(axes, (0.8, 0.9, 1, 1.2, 1.5, 2, 3, 4, 5, 7, 10, 20, 50, 100))
    axes.set_xlabel("RMSE / sigma the filter claims (log scale); shaded: not refuted")
    first = next(iter(campaigns.values()))
    noise = first.configuration["noise"]
    figure.suptitle(
        "Is the filter's own sigma honest? "
        f"{style.schedule_text(first.configuration)}, {_runs_text(campaigns.values())} each\n"
        f"{noise['name']} noise: {style.noise_text(noise)}"
    )
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def _draw_ratios(axes: Axes, campaign: Campaign, offset: float, passes: int) -> None:
    order, table = list(style.ORDER), campaign.table
    # 0 where the filter does not model the parameter: nothing to draw there
    sigma = table["predicted_std"].where(table["predicted_std"] > 0.0)
    ratio, lower, upper = (
        (table[name] / sigma).to_numpy()[order] for name in ("rmse", "rmse_lower", "rmse_upper")
    )
    axes.errorbar(
        ratio,
        np.array(style.row_positions()) + offset,
        xerr=[ratio - lower, upper - ratio],
        fmt="s" if passes == 1 else "o",
        color=style.PASS_COLORS[passes],
        markersize=4,
        linewidth=1.5,
        label=f"{style.passes_text(passes)}, 95 % interval",
    )


@style.styled
def nees(campaigns: Mapping[int, Campaign]) -> Figure:
    """Histograms of the NEES against the chi-square density of a consistent filter.

    Parameters
    ----------
    campaigns : mapping of int to Campaign
        By number of passes.

    Returns
    -------
    Figure
    """
    figure = Figure(figsize=(10, 5.5))
    axes = figure.subplots()
    first = next(iter(campaigns.values()))
    dof = int((first.table["predicted_std"] > 0.0).sum())
    view = _NEES_VIEW * dof
    edges = np.linspace(0.0, view, 2 * _BINS + 1)
    for passes, campaign in campaigns.items():
        values = campaign.runs["nees"].to_numpy()
        # weights, not density=True: a clipped run still counts as a run
        weights = np.full(len(values), 1.0 / (len(values) * (edges[1] - edges[0])))
        axes.hist(
            values,
            edges.tolist(),
            weights=weights,
            color=style.PASS_COLORS[passes],
            alpha=_FILL,
            label=_nees_label(values, passes, view),
        )
    x = np.linspace(0.0, view, 400)
    chi_square = f"chi-square with {dof} degrees of freedom: mean {dof}"
    axes.plot(x, density.chi_square(x, dof), color=style.PREDICTION_COLOR, label=chi_square)
    axes.set_xlim(0.0, view)
    axes.set_xlabel("NEES of a run (normalised estimation error squared)")
    axes.set_ylabel("density")
    axes.legend(loc="upper right")
    noise = first.configuration["noise"]
    figure.suptitle(
        f"NEES: {style.schedule_text(first.configuration)}, {_runs_text(campaigns.values())} each\n"
        f"{noise['name']} noise: {style.noise_text(noise)}"
    )
    return figure


def _nees_label(values: np.ndarray, passes: int, view: float) -> str:
    clipped = int((values > view).sum())
    text = f"{style.passes_text(passes)}: mean {values.mean():.1f}"
    if clipped:
        text += f"; {clipped} of {len(values)} runs beyond {view}, up to {values.max():.0f}"
    return text


@style.styled
def schedule_comparison(comparisons: Mapping[str, Mapping[str, Any]], noise: str) -> Figure:
    """RMSE ratio of two schedules, a panel per comparison.

    Parameters
    ----------
    comparisons : mapping of str to dict
        By title of the panel, as read from a comparison's JSON file.
    noise : str
        Noise in words, for the title.

    Returns
    -------
    Figure
    """
    figure = Figure(figsize=(12, 10))
    panels = figure.subplots(1, len(comparisons), sharex=True, squeeze=False)[0]
    for number, (axes, (title, comparison)) in enumerate(
        zip(panels, comparisons.items(), strict=True)
    ):
        axes.set_xscale("log")
        style.draw_rows(axes)
        if number:
            axes.set_yticklabels([])
        _draw_comparison(axes, comparison)
        duration_a, duration_b = (f"{duration:.0f} s" for duration in comparison["duration_s"])
        axes.set_title(
            f"{title}: {duration_a} against {duration_b}\n{comparison['a']} over {comparison['b']}"
        )
        axes.axvline(1.0, color=style.LIMIT_COLOR, linewidth=1)
        style.log_ticks(axes, (0.5, 0.6, 0.7, 0.8, 0.9, 1, 1.2, 1.5, 2, 2.5, 3, 4))
        axes.set_xlabel("RMSE with 19 positions / RMSE with 25 (log scale)")
    runs = next(iter(comparisons.values()))["runs_paired"]
    figure.suptitle(
        f"19 against 25 positions, {runs} paired runs: right of 1, 25 positions are better\n{noise}"
    )
    figure.legend(
        handles=[
            style.handle(
                "RMSE ratio, pointwise 95 %", color=style.SCHEDULE_COLOR, marker="o", lw=3
            ),
            style.handle("95 % for all parameters at once", color=style.SCHEDULE_COLOR, lw=1),
            style.handle(
                "ratio of the filter's sigmas",
                color=style.PREDICTION_COLOR,
                marker="D",
                linestyle="none",
            ),
        ],
        loc="outside lower center",
        ncols=3,
    )
    return figure


def _draw_comparison(axes: Axes, comparison: Mapping[str, Any]) -> None:
    table = [comparison["parameters"][NAMES[index]] for index in style.ORDER]
    rows = style.row_positions()

    def column(name: str) -> list[float]:
        return [row[name] for row in table]

    axes.hlines(
        rows,
        column("simultaneous_lower"),
        column("simultaneous_upper"),
        color=style.SCHEDULE_COLOR,
        linewidth=1,
    )
    axes.hlines(rows, column("lower"), column("upper"), color=style.SCHEDULE_COLOR, linewidth=3)
    axes.plot(column("ratio"), rows, "o", color=style.SCHEDULE_COLOR, markersize=4.5)
    below = [row + _BELOW for row in rows]
    axes.plot(column("predicted_ratio"), below, "D", color=style.PREDICTION_COLOR, markersize=3.5)


def _setup_text(campaign: Campaign) -> str:
    schedule, passes = style.schedule_text(campaign.configuration), campaign.passes
    return f"{schedule}, {style.passes_text(passes)}"


def _runs_text(campaigns: Any) -> str:
    """Count of runs in words; a range if campaigns differ."""
    counts = sorted({campaign.runs.sizes["run"] for campaign in campaigns})
    return f"{' to '.join(map(str, (counts[0], counts[-1])[: len(counts)]))} runs"
