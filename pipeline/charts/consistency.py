"""The figures of the consistency study."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from inscal import statistics
from inscal.innovations import InnovationStatistics, white_band
from inscal.parameters import NAMES
from inscal.record import OBSERVED
from pipeline.charts import style
from pipeline.proof.looks import OUTSIDE_BAND
from pipeline.proof.statistics import CONFIDENCE, COVERING, LAGS, OBSERVATIONS
from pipeline.words import markdown as md

_LOWEST_CENTILE = 80.0  # of the zip plot: below, every interval covers
_COVERS, _MISSES = style.NOISE_COLORS["reference"], style.NOISE_COLORS["noisy"]
_BLOCKS = 125  # of the NIS over time
_BAND = "#bbbbbb"
_COMPONENT_COLORS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00")


@style.styled
def zip_plot(done: xr.Dataset, study: xr.Dataset) -> Figure:
    """95 % intervals of all runs, ranked by |z|, a panel per parameter (Morris et al. 2019).

    Parameters
    ----------
    done : xarray.Dataset
        Runs done.
    study : xarray.Dataset
        From `pipeline.proof.statistics.estimates`.

    Returns
    -------
    Figure
    """
    figure = Figure(figsize=(10, 15))
    panels = figure.subplots(9, 3, sharex=True, sharey=True)
    error = done["error"].transpose("run", "parameter").to_numpy()
    score = error / done["predicted_std"].to_numpy()
    for axes, index in zip(panels.flat, style.ORDER, strict=True):
        _draw_zip(axes, score[:, index])
        row = study.sel(parameter=NAMES[index])
        share, mcse = (100 * float(row[f"coverage_95_percent{end}"]) for end in ("", "_mcse"))
        axes.set_title(f"{style.label(index)}: {share:.1f} % cover (±{mcse:.1f})", fontsize=8.5)
    view = 1.02 * (np.abs(score).max() + COVERING)
    panels[0, 0].set_xlim(-view, view)
    for axes in panels[-1]:
        axes.set_xlabel("(estimate − truth) / sigma")
    for axes in panels[:, 0]:
        axes.set_ylabel("centile of |z|")
    figure.suptitle(
        f"Zip plot: the filter's 95 % intervals of {len(error)} runs, ranked by |z|, |z| largest "
        f"at the top\ncentiles above {_LOWEST_CENTILE:g}; an honest filter changes colour at 95"
    )
    figure.legend(
        handles=[
            style.handle("interval covers the truth", color=_COVERS, linewidth=4),
            style.handle("interval misses it", color=_MISSES, linewidth=4),
            style.handle("95 % of runs", color=style.LIMIT_COLOR),
            style.handle(
                "95 % interval of the coverage found", color=style.LIMIT_COLOR, linestyle="--"
            ),
        ],
        loc="outside lower center",
        ncols=4,
    )
    return figure


def _draw_zip(axes: Axes, score: np.ndarray) -> None:
    ranked = score[np.argsort(np.abs(score))]
    centile = 100.0 * (np.arange(len(ranked)) + 0.5) / len(ranked)
    covers = np.abs(ranked) <= COVERING
    shown = centile > _LOWEST_CENTILE
    for chosen, color in ((shown & covers, _COVERS), (shown & ~covers, _MISSES)):
        ends = [
            ((z - COVERING, height), (z + COVERING, height))
            for z, height in zip(ranked[chosen], centile[chosen], strict=True)
        ]
        axes.add_collection(LineCollection(ends, colors=color, linewidths=0.7))
    axes.axvline(0.0, color=style.LIMIT_COLOR, linewidth=0.8)
    axes.axhline(95.0, color=style.LIMIT_COLOR, linewidth=1.0)
    _, lower, upper = statistics.wilson_interval(covers.sum(), len(covers))
    for end in (lower, upper):
        axes.axhline(100.0 * float(end), color=style.LIMIT_COLOR, linewidth=0.8, linestyle="--")
    axes.set_ylim(_LOWEST_CENTILE, 100.0)


@style.styled
def innovations(repeated: InnovationStatistics, study: xr.Dataset) -> Figure:
    """NIS over time, and autocorrelations against the band of white noise, by pass.

    Parameters
    ----------
    repeated : InnovationStatistics
    study : xarray.Dataset
        With the attributes of the stage.

    Returns
    -------
    Figure
    """
    about = study.attrs["innovations"]
    passes = len(repeated.nis)
    figure = Figure(figsize=(12, 9))
    top, bottom = figure.subfigures(2, 1, squeeze=False)[:, 0]
    _draw_nis(top.subplots(), repeated.nis, study.attrs)
    panels = bottom.subplots(1, passes + 1, squeeze=False)[0]
    for axes in panels[1:passes]:
        axes.sharey(panels[0])
    for number, axes in enumerate(panels[:passes]):
        _draw_correlation(axes, repeated.autocorrelation[number, 0].mean(axis=-1), about)
        axes.set_title(f"pass {number + 1}: mean autocorrelation of {about['runs']} runs")
    panels[0].legend(ncols=2, fontsize=8)
    _draw_shares(panels[passes], about)
    figure.suptitle(
        f"Innovations of {about['runs']} runs, {about['updates']} updates each: "
        f"{study.attrs['positions']} positions of {study.attrs['position_duration_s']:g} s\n"
        f"{study.attrs['noise']['name']} noise: {style.noise_text(study.attrs['noise'])}"
    )
    return figure


def _draw_nis(axes: Axes, nis: np.ndarray, about: dict[str, Any]) -> None:
    updates, runs = nis.shape[1:]
    blocks = np.array_split(np.arange(updates), min(_BLOCKS, updates))
    per_position = about["positions"] / updates
    lower, upper = statistics.nees_interval(len(blocks[0]) * runs, OBSERVED, CONFIDENCE)
    axes.axhspan(lower, upper, color=_BAND, alpha=0.5, linewidth=0)
    axes.axhline(OBSERVED, color=style.LIMIT_COLOR, linewidth=1)
    middle = [1.0 + per_position * (block[0] + block[-1] + 1) / 2 for block in blocks]
    for number, of_pass in enumerate(nis, start=1):
        axes.plot(
            middle,
            [of_pass[block].mean() for block in blocks],
            "os"[number % 2] + "-",
            color=_pass_color(number),
            markersize=3,
            linewidth=1,
            label=f"pass {number}: mean {of_pass.mean():.4f}",
        )
    axes.set_xlim(1, about["positions"] + 1)
    axes.set_xticks(range(1, about["positions"] + 1))
    axes.grid(axis="x", color=_BAND, linewidth=0.5)
    axes.set_xlabel("position: each dwells from its number on, then turns to the next")
    axes.set_ylabel(f"NIS, mean of {len(blocks[0])} updates\nof {runs} runs")
    axes.set_title(f"shaded: {100 * CONFIDENCE:g} % of the points of an optimal filter")
    axes.legend(loc="upper right", ncols=len(nis))


def _draw_correlation(axes: Axes, mean: np.ndarray, about: dict[str, Any]) -> None:
    band = white_band(about["runs"] * about["updates"])
    axes.axhspan(-band, band, color=_BAND, alpha=0.5, linewidth=0, label="95 % of white noise")
    axes.axhline(0.0, color=style.LIMIT_COLOR, linewidth=0.8)
    for component, (name, color) in enumerate(zip(OBSERVATIONS, _COMPONENT_COLORS, strict=True)):
        axes.plot(LAGS, mean[:, component], "o-", color=color, markersize=3, lw=1, label=name)
    axes.set_xlabel("lag, updates")
    axes.set_xticks(range(5, LAGS[-1] + 1, 5))


def _draw_shares(axes: Axes, about: dict[str, Any]) -> None:
    labels = []
    for number, one in enumerate(about["passes"], start=1):
        for row, stretch in enumerate(one["stretches"]):
            share = {k: 100 * v for k, v in stretch["share_beyond_band"].items()}
            height = row + 0.2 * (number - (len(about["passes"]) + 1) / 2)
            label = f"pass {number}, {100 * CONFIDENCE:g} % interval (whole: its goal's)"
            axes.errorbar(
                share["value"],
                height,
                xerr=[[share["value"] - share["lower"]], [share["upper"] - share["value"]]],
                fmt="os"[number % 2],
                color=_pass_color(number),
                markersize=4,
                label=None if row else label,
            )
    for stretch in about["passes"][0]["stretches"]:
        first, last = stretch["first_position"], stretch["last_position"]
        labels.append(md.ends((first, last)))
    axes.axvline(100 * OUTSIDE_BAND, color=style.LIMIT_COLOR, linewidth=1)
    axes.set_yticks(range(len(labels)), labels)
    axes.invert_yaxis()
    axes.set_ylabel("positions")
    axes.set_xlabel("% of single runs' autocorrelations beyond\ntheir 95 % band; line: white noise")
    axes.legend(fontsize=8)


def _pass_color(number: int) -> str:
    return style.PASS_COLORS[min(number, max(style.PASS_COLORS))]
