"""Charts of the HTML page: Vega-Lite specifications, written with Altair.

Colours are CSS variables of the page's style sheet (``templates/report.css``), so that light, dark
and print need no script; they follow Okabe and Ito, and shape or dash tells what colour tells.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import altair as alt

from inscal.parameters import NAMES
from pipeline.page.places import ratio_ticks

Rows = Sequence[Mapping[str, Any]]
Spec = dict[str, Any]

BLUE, ORANGE, GREEN, PINK = "var(--blue)", "var(--orange)", "var(--green)", "var(--pink)"
INK, QUIET, BAND = "var(--ink)", "var(--quiet)", "var(--band)"
FOUND, PREDICTED = BLUE, PINK
"""What runs show of the main campaign, and what its filter claims: the same in every chart."""

_SERIES = (FOUND, ORANGE, GREEN, QUIET)
_SHAPES = ["circle", "diamond", "square", "triangle-up"]
_DASHES = [[1, 0], [6, 3], [2, 2], [8, 2, 2, 2]]
_TIME = alt.Scale(nice=False)
_ROW = 19  # height of a parameter's row, in pixels

THEME: Spec = {
    "background": "transparent",
    "font": "system-ui, sans-serif",
    "view": {"stroke": None},
    "axis": {
        **{"labelColor": INK, "titleColor": INK, "domainColor": QUIET, "tickColor": QUIET},
        **{"gridColor": "var(--grid)", "labelFontSize": 12, "titleFontSize": 12},
        **{"titleFontWeight": "normal", "labelLimit": 260},
    },
    "legend": {
        **{"labelColor": INK, "titleColor": INK, "labelFontSize": 12, "titleFontSize": 12},
        **{"orient": "top", "labelLimit": 400, "titleFontWeight": "normal", "columns": 1},
        **{"symbolStrokeWidth": 2},
    },
    "title": {
        **{"color": INK, "subtitleColor": INK, "fontSize": 13, "subtitleFontSize": 11.5},
        **{"anchor": "start", "fontWeight": 600},
    },
    "text": {"color": INK, "fontSize": 12},
}
"""Configuration that all charts share."""


def _spec(chart: alt.TopLevelMixin) -> Spec:
    spec = chart.to_dict()
    del spec["$schema"], spec["config"]
    return spec


def _data(rows: Rows) -> alt.InlineData:
    return alt.InlineData(values=list(rows))


def _sized(chart: Any, height: float, title: Any = None) -> Any:
    chart = chart.properties(width="container", height=height)
    return chart.properties(title=title) if title else chart


def _title(text: str, below: str | Sequence[str] = "") -> alt.TitleParams:
    return alt.TitleParams(text, subtitle=below) if below else alt.TitleParams(text)


def _at(value: float, axis: str = "x", color: str = INK, dash: Sequence[int] = (5, 3)) -> alt.Chart:
    encoding: Any = {axis: alt.datum(value)}
    mark: Any = {"color": color, "strokeDash": list(dash), "strokeWidth": 1.4}
    return alt.Chart(_data([{}])).mark_rule(**mark).encode(**encoding)


def _series(
    field: str, names: Sequence[str], chosen: Sequence[str] = _SERIES
) -> tuple[alt.Color, alt.Shape]:
    """Colour and shape of a few series, with one legend."""
    count, legend = len(names), alt.Legend(title=None) if len(names) > 1 else None
    colors = [chosen[i % len(chosen)] for i in range(count)]
    shapes = [_SHAPES[(i + i // 4) % 4] for i in range(count)]
    return (
        alt.Color(f"{field}:N", scale=alt.Scale(domain=names, range=colors), legend=legend),
        alt.Shape(f"{field}:N", scale=alt.Scale(domain=names, range=shapes), legend=legend),
    )


def _parameters(**axis: Any) -> alt.Y:
    """Make an axis of the parameters in their order."""
    return alt.Y("parameter:N", sort=list(NAMES), axis=alt.Axis(title=None, **axis))


def _ratio(title: str, rows: Rows) -> alt.X:
    """Make an axis of ratios with intervals."""
    ends = [1.0, *(row[end] for row in rows for end in ("lower", "upper"))]
    ticks = ratio_ticks(min(ends), max(ends))
    return alt.X(
        "ratio:Q",
        scale=alt.Scale(type="log", nice=False, padding=8),
        axis=alt.Axis(title=f"{title} (logarithmic)", format="~g", values=ticks),
    )


def _histogram(bars: Rows, quantity: str) -> alt.Chart:
    return (
        alt.Chart(_data(bars))
        .mark_rect(color=FOUND, opacity=0.75, tooltip=True)
        .encode(
            x=alt.X("from:Q"),
            x2="to:Q",
            y=alt.Y("runs:Q"),
            y2=alt.datum(0),
            tooltip=[
                alt.Tooltip("from:Q", title=f"{quantity} from"),
                alt.Tooltip("to:Q", title="to"),
                alt.Tooltip("runs:Q", title="runs"),
            ],
        )
    )


def distribution(found: Mapping[str, Any], title: str, below: str, unit: str, height: int) -> Spec:
    """Histogram of a parameter's errors with the claimed normal curve and the bounds in view."""
    view = found["view"]
    x = alt.X(
        "from:Q",
        scale=alt.Scale(domain=[-view, view], nice=False),
        axis=alt.Axis(title=f"error, {unit}", tickCount=5, grid=False),
    )
    y = alt.Y("runs:Q", axis=alt.Axis(title="runs", tickCount=3))
    layers: list[alt.Chart] = [_histogram(found["bars"], "error").encode(x=x, y=y)]
    if found["curve"]:
        curve = alt.Chart(_data(found["curve"])).mark_line(color=PREDICTED, strokeWidth=2)
        layers.append(curve.encode(x="error:Q", y="runs:Q"))
    if found["bound"] <= view:
        layers += [_at(sign * found["bound"]) for sign in (-1, 1)]
    return _spec(_sized(alt.layer(*layers), height, _title(title, below)))


def correlation(rows: Rows, chance: float) -> Spec:
    """Correlations of one parameter's errors with all others', found and claimed."""
    order = [row["other"] for row in rows]
    y = alt.Y("other:N", sort=order, axis=alt.Axis(title=None, grid=False))
    x = alt.X(
        "errors:Q",
        scale=alt.Scale(domain=[-1, 1]),
        axis=alt.Axis(title="correlation of errors", tickCount=5),
    )
    tips = [
        alt.Tooltip("other:N", title="with"),
        alt.Tooltip("errors:Q", title="of the errors"),
        alt.Tooltip("filter:Q", title="claimed by the filter"),
    ]
    band = alt.Chart(_data([{"low": -chance, "high": chance}])).mark_rect(color=BAND)
    base = alt.Chart(_data(rows))
    bars = base.mark_bar(color=FOUND, opacity=0.75, height=8).encode(x=x, y=y, tooltip=tips)
    claimed = base.mark_tick(color=PREDICTED, thickness=3, height=12).encode(
        x="filter:Q", y=y, tooltip=tips
    )
    return _spec(_sized(band.encode(x="low:Q", x2="high:Q") + bars + claimed, 15 * len(rows)))


def course(rows: Rows, ticks: Sequence[float], linear: float, title: str, unit: str) -> Spec:
    """Error of one run beside plus and minus the predicted sigma, over time.

    Up to about `linear` the scale is linear, beyond it logarithmic.
    """
    scale = alt.Scale(type="symlog", constant=linear, nice=False)
    values = [*(-tick for tick in ticks), 0.0, *ticks]
    axis = alt.Axis(title=f"error, {unit}", values=values, format="~g")
    y = alt.Y("low:Q", scale=scale, axis=axis)
    x = alt.X("time_s:Q", scale=_TIME, axis=alt.Axis(title="time, s", grid=False, tickCount=5))
    base = alt.Chart(_data(rows)).transform_calculate(low="-datum.sigma")
    band = base.mark_area(color=PREDICTED, opacity=0.3, line=False).encode(x=x, y=y, y2="sigma:Q")
    line = base.mark_line(color=FOUND, strokeWidth=1.5).encode(x=x, y=alt.Y("error:Q"))
    return _spec(_sized(band + line, 125, _title(title)))


def ratios(rows: Rows, series: Sequence[str], limits: tuple[float, float]) -> Spec:
    """RMSE over predicted sigma, a row per parameter, with intervals and a band of limits."""
    color, shape = _series("campaign", series)
    x, y = _ratio("RMSE over predicted sigma", rows), _parameters(grid=True)
    offset = alt.YOffset("campaign:N", sort=list(series))
    base = alt.Chart(_data(rows))
    tips = [
        alt.Tooltip("parameter:N"),
        alt.Tooltip("campaign:N"),
        alt.Tooltip("ratio:Q", format=".3f", title="RMSE over predicted"),
        alt.Tooltip("lower:Q", format=".3f", title="95 % from"),
        alt.Tooltip("upper:Q", format=".3f", title="to"),
    ]
    band = alt.Chart(_data([dict(zip(("low", "high"), limits, strict=True))]))
    several = {"yOffset": offset} if len(series) > 1 else {}
    layers = [
        band.mark_rect(color=BAND).encode(x="low:Q", x2="high:Q"),
        _at(1.0),
        base.mark_rule(strokeWidth=2).encode(
            x=alt.X("lower:Q"), x2="upper:Q", y=y, color=color, **several
        ),
        base.mark_point(filled=True, size=45, opacity=1).encode(
            x=x, y=y, color=color, shape=shape, tooltip=tips, **several
        ),
    ]
    return _spec(_sized(alt.layer(*layers), _height(rows, series)))


def _height(rows: Rows, series: Sequence[str]) -> float:
    parameters = len({row["parameter"] for row in rows})
    return parameters * max(_ROW, 8 * len(series) + 4)


def nees(found: Mapping[str, Any], title: str, below: str) -> Spec:
    """Histogram of the NEES and the curve of an honest filter."""
    x = alt.X(
        "from:Q",
        scale=alt.Scale(domain=[0.0, found["view"]]),
        axis=alt.Axis(title="NEES of a run", grid=False),
    )
    bars = _histogram(found["bars"], "NEES").encode(x=x)
    curve = alt.Chart(_data(found["curve"])).mark_line(color=PREDICTED, strokeWidth=2)
    curve = curve.encode(x="nees:Q", y=alt.Y("runs:Q", axis=alt.Axis(title="runs")))
    return _spec(_sized(bars + curve, 230, _title(title, below)))


def contest(rows: Rows, title: str, below: Sequence[str]) -> Spec:
    """RMSE ratio of two campaigns, a row per parameter, with intervals that hold for all."""
    x, y = _ratio("RMSE ratio", rows), _parameters(grid=True)
    words = ["worse", "no difference shown", "better"]
    scale = alt.Scale(domain=words, range=[ORANGE, QUIET, GREEN])
    shapes = alt.Scale(domain=words, range=["triangle-right", "circle", "triangle-left"])
    legend = alt.Legend(title=None)
    color = alt.Color("word:N", scale=scale, legend=legend)
    shape = alt.Shape("word:N", scale=shapes, legend=legend)
    tips = [
        alt.Tooltip("parameter:N"),
        alt.Tooltip("ratio:Q", format=".3f"),
        alt.Tooltip("lower:Q", format=".3f", title="for all at once, 95 % from"),
        alt.Tooltip("upper:Q", format=".3f", title="to"),
        alt.Tooltip("predicted:Q", format=".3f", title="ratio of predicted sigmas"),
    ]
    base = alt.Chart(_data(rows))
    layers = [
        _at(1.0),
        base.mark_rule(strokeWidth=2).encode(x=alt.X("lower:Q"), x2="upper:Q", y=y, color=color),
        base.mark_point(filled=True, size=60, opacity=1).encode(
            x=x, y=y, color=color, shape=shape, tooltip=tips
        ),
        base.mark_tick(color=PREDICTED, thickness=2, height=14).encode(x="predicted:Q", y=y),
    ]
    return _spec(_sized(alt.layer(*layers), _height(rows, [""]), _title(title, below)))


def convergence(rows: Rows, ends: Rows, needed: float, title: str) -> Spec:
    """Predicted sigma over bound, a line per parameter of a kind, over time, named at its end."""
    x = alt.X("time_s:Q", scale=_TIME, axis=alt.Axis(title="time, s", grid=False, tickCount=4))
    y = alt.Y(
        "share:Q",
        scale=alt.Scale(type="log", nice=False),
        axis=alt.Axis(title="sigma over bound", format="~g", tickCount=4),
    )
    tips = [
        alt.Tooltip("parameter:N"),
        alt.Tooltip("time_s:Q"),
        alt.Tooltip("share:Q", format=".3g", title="sigma over bound"),
    ]
    lines = alt.Chart(_data(rows)).mark_line(color=PREDICTED, strokeWidth=1.5)
    lines = lines.encode(x=x, y=y, detail="parameter:N", tooltip=tips)
    labels = alt.Chart(_data(ends)).mark_text(align="left", dx=4, fontSize=11)
    labels = labels.encode(x="time_s:Q", y="share:Q", text="label:N")
    return _spec(_sized(_at(needed, "y") + lines + labels, 150, _title(title)))


def ranks(rows: Rows, series: Sequence[str], states: int) -> Spec:
    """Rank after each position, a staircase per convention."""
    color, shape = _series("by", series, (INK, FOUND, QUIET))
    dash = alt.StrokeDash(
        "by:N",
        scale=alt.Scale(domain=series, range=[_DASHES[i % 4] for i in range(len(series))]),
        legend=alt.Legend(title=None),
    )
    x = alt.X(
        "position:Q",
        scale=alt.Scale(nice=False, zero=False),
        axis=alt.Axis(title="position", grid=False, tickMinStep=1),
    )
    y = alt.Y(
        "rank:Q",
        scale=alt.Scale(domain=[0, states + 1], nice=False),
        axis=alt.Axis(title="rank", tickCount=6),
    )
    base = alt.Chart(_data(rows))
    line = base.mark_line(interpolate="step-after", strokeWidth=2)
    points = base.mark_point(filled=True, size=40, opacity=1)
    tips = [alt.Tooltip("by:N"), alt.Tooltip("position:Q"), alt.Tooltip("rank:Q")]
    layers = (
        _at(states, "y"),
        line.encode(x=x, y=y, color=color, strokeDash=dash),
        points.encode(x=x, y=y, color=color, shape=shape, tooltip=tips),
    )
    return _spec(_sized(alt.layer(*layers), 260))


def shares(rows: Rows) -> Spec:
    """Sigma over initial sigma after each position, a row per parameter."""
    color = alt.Color(
        "share:Q",
        scale=alt.Scale(type="log", scheme="viridis"),  # dark: known, as in the figures
        legend=alt.Legend(
            title="sigma over initial sigma (logarithmic)", format="~g", titleLimit=320
        ),
    )
    chart = alt.Chart(_data(rows)).mark_rect(stroke=None)
    chart = chart.encode(
        x=alt.X(
            "position:O", axis=alt.Axis(title="after position", labelAngle=0, labelOverlap=True)
        ),
        y=_parameters(),
        color=color,
        tooltip=[
            alt.Tooltip("parameter:N"),
            alt.Tooltip("position:O"),
            alt.Tooltip("share:Q", format=".3g", title="sigma over initial sigma"),
        ],
    )
    return _spec(_sized(chart, _height(rows, [""])))


def scattered(
    rows: Rows,
    *,
    field: str,
    order: Sequence[str],
    series: Sequence[str],
    axis: str,
    colors: Sequence[str] = _SERIES,
) -> Spec:
    """Points of a few series on one row per `field`, against a line at 1."""
    color, shape = _series("series", series, colors)
    scale = alt.Scale(type="log", nice=False, padding=12)
    x = alt.X("value:Q", scale=scale, axis=alt.Axis(title=axis, format="~g"))
    y = alt.Y(f"{field}:N", sort=list(order), axis=alt.Axis(title=None, grid=True))
    base = alt.Chart(_data(rows))
    points = base.mark_point(filled=True, size=70, opacity=1).encode(
        x=x,
        y=y,
        color=color,
        shape=shape,
        tooltip=[
            alt.Tooltip(f"{field}:N"),
            alt.Tooltip("series:N"),
            alt.Tooltip("value:Q", format=".3g", title=axis),
        ],
    )
    labels = base.mark_text(align="left", dx=9).encode(x="value:Q", y=y, text="label:N")
    return _spec(_sized(_at(1.0) + points + labels, 24 * len(order)))


def history(rows: Rows, band: tuple[float, float], expected: float, title: str) -> Spec:
    """One figure of accuracy at every baseline and now, against what an honest filter shows."""
    order = [row["when"] for row in rows]
    x = alt.X("when:N", sort=order, axis=alt.Axis(title=None, labelAngle=0, labelLimit=90))
    y = alt.Y(
        "value:Q", scale=alt.Scale(zero=False, nice=True), axis=alt.Axis(title=None, tickCount=4)
    )
    base = alt.Chart(_data(rows))
    words = ["baseline", "this campaign"]
    scales = (
        alt.Scale(domain=words, range=[QUIET, FOUND]),
        alt.Scale(domain=words, range=["circle", "diamond"]),
    )
    points = base.mark_point(filled=True, size=80, opacity=1).encode(
        x=x,
        y=y,
        color=alt.Color("what:N", scale=scales[0], legend=None),
        shape=alt.Shape("what:N", scale=scales[1], legend=None),
        tooltip=[
            alt.Tooltip("when:N"),
            alt.Tooltip("reason:N"),
            alt.Tooltip("value:Q", format=".4g"),
        ],
    )
    shade = alt.Chart(_data([dict(zip(("low", "high"), band, strict=True))]))
    shade = shade.mark_rect(color=BAND).encode(y="low:Q", y2="high:Q")
    line = base.mark_line(color=QUIET, strokeWidth=1).encode(x=x, y=y)
    layers = alt.layer(shade, _at(expected, "y"), line, points)
    return _spec(_sized(layers, 130, _title(title)))
