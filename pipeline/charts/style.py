"""What all figures share: colours, labels, the rows of the 27 parameters, saving."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from inscal.parameters import KIND_OF, KINDS, NAMES, members
from pipeline.config.load import position_durations
from pipeline.console.output import written
from pipeline.words import markdown as md

styled = mpl.rc_context(
    {
        "font.size": 9.0,
        "axes.titlesize": 10.0,
        "figure.titlesize": 12.0,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "legend.frameon": False,
        "axes.axisbelow": True,
        "figure.constrained_layout.use": True,
    }
)
"""Decorator of functions that draw."""

# Okabe and Ito's palette, told apart by colour-blind readers; never the only distinction.
NOISE_COLORS: dict[str, str] = {"quiet": "#009E73", "reference": "#0072B2", "noisy": "#D55E00"}
PASS_COLORS: dict[int, str] = {1: "#E69F00", 2: NOISE_COLORS["reference"]}
SCHEDULE_COLOR = "#444444"
PREDICTION_COLOR = "#AA3377"
LIMIT_COLOR = "#000000"

_DPI = 120
_BAND_COLOR = "#f2f2f2"
_KIND_GAP = 0.6  # rows of space between two kinds
_PASS_NAMES = {1: "one pass", 2: "two passes"}
_KIND_TEXTS = {kind: kind.replace("_", " ").replace("accel", "accel.", 1) for kind in KINDS}
_UNIT_TEXTS = {"deg/h": "°/h", "ug": "µg"}
_QUADRATIC_TEXTS = {"pulse": "10⁻⁹ s/pulse", "si": "10⁻⁹ s²/m"}

ORDER: tuple[int, ...] = tuple(int(index) for kind in KINDS for index in members(kind))
"""Indices of the parameters in the order of the figures: by kind."""


def label(index: int) -> str:
    """Readable name of a parameter, such as ``gyro installation k21``."""
    return f"{_KIND_TEXTS[KIND_OF[index]]} {NAMES[index].rsplit('_', 1)[1]}"


def unit_text(kind: str, quadratic_unit: str) -> str:
    """Readable unit of a kind; that of the quadratic term depends on how it is read."""
    if kind == "accel_quadratic":
        return _QUADRATIC_TEXTS[quadratic_unit]
    unit = KINDS[kind].unit
    return _UNIT_TEXTS.get(unit, unit)


def noise_text(noise: Mapping[str, Any]) -> str:
    """Noise levels in one line."""
    return (
        f"gyro {noise['gyro_angle_random_walk_deg_per_sqrt_h']:g} °/√h, "
        f"accel. {noise['accel_white_noise_ug_per_sqrt_hz']:g} µg/√Hz, "
        f"velocity {noise['velocity_observation_m_per_s']:g} m/s, "
        f"position {noise['position_observation_m']:g} m"
    )


def schedule_text(configuration: Mapping[str, Any]) -> str:
    """Schedule of a campaign, such as ``25 positions of 500 s``."""
    durations = position_durations(configuration["schedule"])
    return f"{len(durations)} positions of {md.spread(durations)} s"


def passes_text(passes: int) -> str:
    """Give a number of passes in words."""
    return _PASS_NAMES.get(passes, f"{passes} passes")


def row_positions() -> list[float]:
    """Vertical position of each parameter of `ORDER`, with a gap between kinds."""
    kinds = list(KINDS)
    return [row + _KIND_GAP * kinds.index(KIND_OF[index]) for row, index in enumerate(ORDER)]


def draw_rows(axes: Axes, margin_texts: Sequence[str] = ()) -> None:
    """Make the y axis that of the parameters, each kind on a band of its own.

    Parameters
    ----------
    axes : Axes
    margin_texts : sequence of str
        One per kind, written at the right of its band; none if empty.
    """
    rows = row_positions()
    for number, kind in enumerate(KINDS):
        own = [rows[ORDER.index(index)] for index in members(kind)]
        pad = 0.5 + _KIND_GAP / 2
        if number % 2 == 0:
            axes.axhspan(own[0] - pad, own[-1] + pad, color=_BAND_COLOR, linewidth=0, zorder=0)
        if margin_texts:
            axes.text(
                *(1.01, (own[0] + own[-1]) / 2),
                margin_texts[number],
                transform=axes.get_yaxis_transform(),
                verticalalignment="center",
            )
    axes.set_yticks(rows, [label(index) for index in ORDER])
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(rows[-1] + 0.8, rows[0] - 0.8)


def handle(text: str, **look: Any) -> Line2D:
    """Make an entry of a legend."""
    return Line2D([], [], label=text, **look)


def plain_numbers() -> FuncFormatter:
    """Format ticks as 0.1 and 1 where matplotlib would write powers of ten."""
    return FuncFormatter(lambda value, _: f"{value:g}")


def log_ticks(axes: Axes, ticks: Sequence[float]) -> None:
    """Put the ticks of a logarithmic x axis at round numbers between the powers of ten."""
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(plain_numbers())


def save(figure: Figure, path: str | Path) -> None:
    """Write a figure as PNG, the same bytes whenever it is made.

    Raises
    ------
    DataError
        If the file cannot be written.
    """
    with written(path) as file:
        figure.savefig(file, dpi=_DPI, metadata={"Software": None})
