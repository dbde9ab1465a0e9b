"""Sections of the HTML page on noise, on the paper, and on accuracy over time."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from inscal.parameters import COUNT, KINDS, NAMES, members
from pipeline.config.load import load
from pipeline.config.schema import Config
from pipeline.config.setup import parameter_vector
from pipeline.gate import history
from pipeline.gate.baseline import configuration_of
from pipeline.page import charts as page_charts
from pipeline.page.data import rounded
from pipeline.page.parts import ENOUGH_TEXT, Cell, Picture, Section, Table, cells, kind_words, say
from pipeline.page.verdict import look
from pipeline.study import assumptions, honesty
from pipeline.study.campaign import Campaign
from pipeline.study.claims import Claims
from pipeline.study.verdict import MET, NOT_MET, UNDECIDED

_QUANTILE = "abs_error_p997"
_LIMITS = {"gyro": "gyro noise", "accel": "accelerometer noise"}


def noise(campaigns: Sequence[Campaign], wing: Claims | None) -> Section:
    """Make the section of what noise does to the bounds.

    Parameters
    ----------
    campaigns : sequence of Campaign
        That differ in their noise alone, the main one first; the picture needs two.
    wing : Claims or None
        Has the margins, if there is any.

    Returns
    -------
    Section
    """
    pictures, gist = [], ""
    if len(campaigns) > 1:
        picture, gist = _noise_picture(campaigns)
        pictures.append(picture)
    if wing:
        pictures.append(_margin_picture(wing.margins, wing.largest_noise))
        gist = gist or say("margins_gist", **_failing(wing.margins))
    left_out = "" if pictures else say("no_levels")
    return Section("noise", pictures=pictures, left_out=left_out, gist=gist)


def _failing(margins: Mapping[str, Mapping[str, float]]) -> dict[str, int]:
    """Count the kinds that bear less than the configured noise of the gyros."""
    return {"failing": sum(row["gyro"] < 1.0 for row in margins.values()), "count": len(margins)}


def _noise_picture(campaigns: Sequence[Campaign]) -> tuple[Picture, str]:
    """The picture, and what it says in a few words."""
    rows, texts, sizes = [], [], {}
    for campaign in campaigns:
        table, found = campaign.summary["parameters"], []
        for kind in KINDS:
            own = [table[NAMES[index]] for index in members(kind)]
            found.append(max(row[_QUANTILE] / row["bound"] for row in own))
            label = {"kind": kind_words(kind), "series": campaign.name, "label": ""}
            rows.append(label | {"value": rounded(found[-1])})
        texts.append((campaign.name, sum(worst <= 1.0 for worst in found)))
        sizes[campaign.name] = sum(found)
    main, *others = sizes
    spec = page_charts.scattered(
        rows,
        field="kind",
        order=[kind_words(kind) for kind in KINDS],
        # the main one's colour is its own everywhere, worse ones are orange and better ones green
        series=[main, *sorted(others, key=lambda name: -sizes[name])],
        axis="|error| of 99.7 % / bound",
    )
    sentence = say("noise", campaigns=texts, kinds=len(KINDS))
    gist = say("noise_gist", campaigns=texts, kinds=len(KINDS))
    return Picture(sentence, {"noise": spec}), gist


def _margin_picture(margins: Mapping[str, Mapping[str, float]], largest: float) -> Picture:
    smallest = min(v for row in margins.values() for v in row.values() if v > 0.0) / 2.0
    rows = []
    for kind, row in margins.items():
        for sensor, text in _LIMITS.items():
            factor = row[sensor]
            label = "none" if factor == 0.0 else f"over {largest:g}" if factor > largest else ""
            value = min(max(factor, smallest), largest)
            place = {"kind": kind_words(kind), "series": text, "label": label}
            rows.append(place | {"value": rounded(value)})
    spec = page_charts.scattered(
        rows,
        field="kind",
        order=[kind_words(kind) for kind in margins],
        series=list(_LIMITS.values()),
        axis="largest noise / configured noise",
        colors=(page_charts.PREDICTED, page_charts.QUIET),
    )
    least = min(margins, key=lambda kind: margins[kind]["gyro"])
    sentence = say(
        "margins",
        enough=ENOUGH_TEXT,
        least=kind_words(least),
        tight=margins[least]["gyro"],
        **_failing(margins),
    )
    return Picture(sentence, {"margins": spec})


def assumptions_section(found: Mapping[str, Any] | None) -> Section:
    """Make the section of what results assume, and of what that is worth.

    Parameters
    ----------
    found : mapping or None
        Of `pipeline.study.assumptions.read`.

    Returns
    -------
    Section
    """
    if found is None:
        return Section("assumptions", left_out=say("no_disturbances", path=assumptions.PATH))
    rows = [cells(row) for row in assumptions.rows(found)]
    caption = say("assumptions_caption", runs=found["runs"], name=found["disturbance"])
    table = Table(caption, assumptions.HEADINGS, rows, 2)
    return Section("assumptions", lines=(say("assumptions"),), tables=(table,))


def paper_section(wing: Claims) -> Section:
    """Make the section that puts the paper's claims and estimates beside ours.

    Parameters
    ----------
    wing : Claims

    Returns
    -------
    Section
    """
    tables, words = [], Counter[str]()
    for page in wing.judged:
        for *_, verdict in page.rows:
            words.update(w for w in (MET, NOT_MET, UNDECIDED) if verdict.startswith(w))
        rows = [[*cells(row[:-1]), Cell(row[-1], look=look(row[-1]))] for row in page.rows]
        tables.append(Table(page.title, page.headings, rows, len(page.headings)))
    counts = ", ".join(f"{words[word]} {word}" for word in (MET, NOT_MET, UNDECIDED))
    judged = {"total": words.total(), "counts": counts}
    return Section(
        "paper",
        lines=(say("judged", **judged),),
        gist=say("judged_gist", **judged),
        pictures=[_paper_picture(wing.estimates)],
        tables=[*tables, _table_3(wing.estimates)],
    )


def _paper_picture(table: Mapping[str, Mapping[str, float]]) -> Picture:
    series, rows, scores = ("the paper's run", "our RMSE"), [], []
    bounds = dict(zip(NAMES, parameter_vector(load(["bounds=paper"]).bounds).tolist(), strict=True))
    for name, row in table.items():
        error = abs(row["paper_estimate"] - row["truth"])
        scores.append(error / row["rmse"])
        for what, value in zip(series, (error, row["rmse"]), strict=True):
            place = {"parameter": name, "series": what, "label": ""}
            rows.append(place | {"value": rounded(value / bounds[name])})
    spec = page_charts.scattered(
        rows,
        field="parameter",
        order=list(NAMES),
        series=series,
        axis="error / the paper's bound",
        colors=(page_charts.QUIET, page_charts.FOUND),
    )
    sentence = say(
        "one_run",
        larger=sum(score > 1.0 for score in scores),
        count=len(scores),
        rms=math.sqrt(sum(score**2 for score in scores) / len(scores)),
    )
    return Picture(sentence, {"paper": spec})


def _table_3(table: Mapping[str, Mapping[str, Any]]) -> Table:
    rows = [
        cells(
            (
                f"`{name}`",
                row["unit"],
                f"{row['truth']:g}",
                f"{row['paper_estimate']:g}",
                f"{row['one_run']:.6g}",
                f"{row['mean']:.6g}",
                f"{row['rmse']:.3g}",
            )
        )
        for name, row in table.items()
    ]
    headings = ("parameter", "unit", "truth", "paper's estimate", "our run 0", "our mean", "RMSE")
    return Table("Table 3 of the paper, parameter by parameter", headings, rows, 2, folded=True)


def accuracy_history(rows: Sequence[history.Row], campaign: Campaign, config: Config) -> Section:
    """Make the section of the gate's baselines over time, the campaign being the last point.

    Parameters
    ----------
    rows : sequence of Row
        Baselines, oldest first.
    campaign : Campaign
    config : Config
        That it was made with.

    Returns
    -------
    Section
    """
    if not (campaign.predicted_std > 0.0).all():
        return Section("history", left_out=say("fewer_states"))
    if not rows:
        return Section("history", left_out=say("no_baseline"))
    now = history.row_of(
        campaign.error,
        campaign.predicted_std,
        campaign.runs["nees"].to_numpy(),
        configuration_of(config),
        date="now",
        reason=campaign.name,
    )
    states = [*rows, now]
    last = rows[-1]
    # numbers of a kind together stray no more than one of them alone
    band = honesty.ratio_limits(last.runs, COUNT)
    nees_band = honesty.nees_limits(last.runs, COUNT)
    charts = {"history-nees": _states("mean NEES", states, None, nees_band, float(COUNT))}
    for kind in KINDS:
        if math.isfinite(now.ratio[kind]):
            charts[f"history-{kind}"] = _states(kind_words(kind), states, kind, band, 1.0)
    sentence = say("history", count=len(rows), now=now, last=last)
    table = Table(
        "Baselines and the state now",
        ("date", "reason", "runs", "mean NEES", "configuration"),
        [
            cells((r.date, r.reason, r.runs, f"{r.nees_mean:.2f}", f"`{r.configuration}`"))
            for r in states
        ],
        2,
    )
    pictures = [Picture(sentence, charts, "small")]
    gist = say("history_gist", now=now, last=last)
    return Section("history", pictures=pictures, tables=[table], gist=gist)


def _states(
    title: str,
    states: Sequence[history.Row],
    kind: str | None,
    band: tuple[float, float],
    expected: float,
) -> page_charts.Spec:
    rows = [
        {
            "when": f"{number}: {row.date}" if number < len(states) else row.date,
            "reason": row.reason,
            "what": "baseline" if number < len(states) else "this campaign",
            "value": rounded(row.nees_mean if kind is None else row.ratio[kind]),
        }
        for number, row in enumerate(states, start=1)
    ]
    return page_charts.history(rows, band, expected, title)
