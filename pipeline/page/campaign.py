"""Sections of the HTML page that show one campaign, or several beside each other."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from inscal.observability import STATES
from inscal.parameters import KINDS, NAMES, members
from inscal.statistics import nominal_coverage, normal_quantile
from pipeline.charts import style
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.page import charts as page_charts
from pipeline.page import data as page_data
from pipeline.page.charts import Rows, Spec
from pipeline.page.data import Course
from pipeline.page.parts import ENOUGH_TEXT, Picture, Section, kind_words, say
from pipeline.page.places import apart, decades
from pipeline.study import findings, honesty
from pipeline.study import observability as observe
from pipeline.study.campaign import Campaign
from pipeline.study.claims import Claims
from pipeline.study.findings import ENOUGH, Summary

_SMALL, _LARGE = 110, 150  # heights of histograms, in pixels
_PLAIN = 1e4  # numbers from which on powers of ten are easier to read
_LABEL = 0.09  # height of a label over that of a small chart
_STAIRS = ("dwells alone", "turns on gyros and lever arms")


def distributions(campaign: Campaign) -> Section:
    """Make the section of all parameters' histograms."""
    table, units = campaign.summary["parameters"], page_data.units(campaign)
    charts, beyond_view = {}, 0
    for index in style.ORDER:
        name = NAMES[index]
        found = page_data.distribution(campaign, index)
        beyond_view += found["bound"] > found["view"]
        charts[f"distribution-{name}"] = page_charts.distribution(
            found, style.label(index), _bound_text(campaign, index), units[index], _SMALL
        )
    least = findings.least_within(campaign.summary)
    found = {
        "runs": campaign.summary["runs_done"],
        "missed": 1.0 - table[least]["share_within_bound"],
        "least": least,
    }
    sentence = say("distributions", beyond=beyond_view, count=len(table), **found)
    gist = say("distributions_gist", **found)
    return Section("distributions", pictures=[Picture(sentence, charts, "small")], gist=gist)


def _bound_text(campaign: Campaign, index: int) -> str:
    bound = campaign.summary["parameters"][NAMES[index]]["bound"]
    return say("bound", bound=bound, sigma=campaign.predicted_std[index])


def sigmas(campaigns: Sequence[Campaign]) -> Section:
    """Make the section of predicted against empirical sigma."""
    rows: list[dict[str, Any]] = []
    for campaign in campaigns:
        table = campaign.summary["parameters"]
        for name, ratio in honesty.ratios(campaign.summary).items():
            lower, upper = map(page_data.rounded, findings.ratio_interval(table[name]))
            row = {"parameter": name, "campaign": campaign.name, "ratio": page_data.rounded(ratio)}
            rows.append(row | {"lower": lower, "upper": upper})
    outside = [
        {
            "name": campaign.name,
            "outside": len(honesty.refuted(campaign.summary)),
            "count": findings.degrees_of_freedom(campaign.summary),
        }
        for campaign in campaigns
    ]
    summaries = [campaign.summary for campaign in campaigns]
    fewest = min(summary["runs_done"] for summary in summaries)
    band = honesty.ratio_limits(fewest, max(map(findings.degrees_of_freedom, summaries)))
    sentence = say("ratios", band=band, fewest=fewest, campaigns=outside)
    spec = page_charts.ratios(rows, [campaign.name for campaign in campaigns], band)
    gist = say("ratios_gist", campaigns=outside)
    return Section("sigma", pictures=[Picture(sentence, {"ratios": spec})], gist=gist)


def nees(campaigns: Sequence[Campaign]) -> Section:
    """Make the section of the NEES."""
    charts, texts = {}, []
    for number, campaign in enumerate(campaigns):
        summary, found = campaign.summary, page_data.nees_histogram(campaign)
        mean, dof = summary["nees_mean"], findings.degrees_of_freedom(summary)
        lower, upper = honesty.nees_limits(summary["runs_done"], dof)
        mean_text = f"mean {mean:.2f}" if mean < _PLAIN else f"mean {mean:.2g}"
        below = f"; {found['beyond']} runs beyond {found['view']:g}" if found["beyond"] else ""
        charts[f"nees-{number}"] = page_charts.nees(found, campaign.name, mean_text + below)
        texts.append(
            {
                "name": campaign.name,
                "honesty": honesty.honesty(summary),
                "mean": mean_text,
                "right": dof,
                "lower": lower,
                "upper": upper,
            }
        )
    disturbed = [campaign.name for campaign in campaigns if "disturbances" in campaign.summary]
    sentence = say("nees", campaigns=texts, disturbed=disturbed)
    gist = say("nees_gist", campaigns=texts)
    return Section("nees", pictures=[Picture(sentence, charts, "small wide")], gist=gist)


def contest_section(
    comparisons: Sequence[tuple[str, Summary]], heading: str = "", left_out: str = ""
) -> Section:
    """Make the section of paired comparisons, each with its title; folded, it tells the first."""
    results = [findings.contest(comparison) for _, comparison in comparisons]
    pictures = []
    for number, ((title, comparison), result) in enumerate(zip(comparisons, results, strict=True)):
        rows = [_contest_row(name, row) for name, row in comparison["parameters"].items()]
        spec = page_charts.contest(rows, title, [f"RMSE of {result.a}", f"over RMSE of {result.b}"])
        sentence = say(
            "contest", pairs=comparison["runs_paired"], verdict=findings.contest_verdict(result)
        )
        pictures.append(Picture(sentence, {f"contest-{number}": spec}))
    gist = findings.shares_text(results[0]) if results else ""
    return Section("schedules", pictures=pictures, left_out=left_out, heading=heading, gist=gist)


def _contest_row(name: str, row: Mapping[str, float]) -> dict[str, Any]:
    lower, upper = row["simultaneous_lower"], row["simultaneous_upper"]
    word = "worse" if lower > 1.0 else "better" if upper < 1.0 else "no difference shown"
    numbers = {"ratio": row["ratio"], "lower": lower, "upper": upper}
    numbers["predicted"] = row["predicted_ratio"]
    rounded = {key: page_data.rounded(value) for key, value in numbers.items()}
    return {"parameter": name, "word": word, **rounded}


def convergence(campaign: Campaign, course: Course) -> Section:
    """Make the section of how the predicted sigmas fall over time, in the last pass."""
    table = campaign.summary["parameters"]
    bound = np.array([table[name]["bound"] for name in NAMES])
    share = course.sigma[-1] / bound
    needed = 1.0 / normal_quantile(ENOUGH)
    charts = {}
    for kind in KINDS:
        own = [index for index in members(kind) if share[-1, index] > 0.0]
        rows = [
            {
                "parameter": NAMES[index],
                "time_s": float(time),
                "share": page_data.rounded(share[row, index], 3),
            }
            for index in own
            for row, time in enumerate(course.time_s)
            if row % 2 == 0 or row == len(course.time_s) - 1
        ]
        if rows:
            ends = _ends(own, share, float(course.time_s[-1]), needed)
            spec = page_charts.convergence(rows, ends, needed, kind_words(kind))
            charts[f"convergence-{kind}"] = spec
    found = {
        "good": int(((share[-1] <= needed) & (share[-1] > 0.0)).sum()),
        "modelled": int((share[-1] > 0.0).sum()),
        "needed": needed,
    }
    return Section(
        "convergence",
        pictures=[Picture(say("convergence", enough=ENOUGH_TEXT, **found), charts, "small")],
        gist=say("convergence_gist", **found),
        lines=() if course.as_stored else (say("other_code"),),
    )


def _ends(indices: Sequence[int], share: np.ndarray, time: float, needed: float) -> Rows:
    """Names beside the ends of lines, so far apart that they can be read."""
    shown = np.log(share[:, indices])
    height = max(shown.max(), np.log(needed)) - min(shown.min(), np.log(needed))
    places = np.exp(apart(shown[-1].tolist(), _LABEL * height))
    return [
        {
            "label": NAMES[index].rsplit("_", 1)[1],
            "time_s": time,
            "share": page_data.rounded(float(place), 3),
        }
        for index, place in zip(indices, places, strict=True)
    ]


def observability(config: Config, wing: Claims | None) -> Section:
    """Make the section of ranks and sigmas after each position.

    Parameters
    ----------
    config : Config
    wing : Claims or None
        Has the paper's ranks, shown beside those of a path that begins as the paper's.

    Returns
    -------
    Section
    """
    rows: list[dict[str, Any]] = []
    lasts = []
    for name in _STAIRS:
        counts = observe.rank_counts(config, observe.CONVENTIONS[name])[0].rank
        rows += [{"by": name, "position": n + 1, "rank": int(r)} for n, r in enumerate(counts)]
        full = np.flatnonzero(counts == STATES)
        lasts.append({"name": name, "rank": counts[-1], "full": full[0] + 1 if len(full) else None})
    series = list(_STAIRS)
    ranks = _paper_ranks(config, wing) if wing else ()
    if ranks:
        series.append("the paper's Table 2")
        rows += [{"by": series[-1], "position": n + 1, "rank": r} for n, r in enumerate(ranks)]
    stairs = Picture(
        say("ranks", lasts=lasts, states=STATES, paper=ranks[-1] if ranks else None),
        {"ranks": page_charts.ranks(rows, series, STATES)},
    )
    share = observe.observability_of(Setup(config)).share
    gist = say("ranks_gist", lasts=lasts, states=STATES)
    return Section("observability", pictures=(stairs, _share_picture(share)), gist=gist)


def _paper_ranks(config: Config, wing: Claims) -> Sequence[int]:
    """Give the paper's ranks along a path; none if it is not the paper's or its head."""
    own, paper = config.schedule.rotations, wing.rotations
    same = len(own) < len(wing.ranks) and [*map(tuple, own)] == [*map(tuple, paper[: len(own)])]
    return wing.ranks[: len(own) + 1] if same else ()


def _share_picture(share: np.ndarray) -> Picture:
    known = [i for i in range(len(NAMES)) if share[-1, i] > 0.0]
    rows: Rows = [
        {
            "parameter": NAMES[index],
            "position": position + 1,
            "share": page_data.rounded(share[position, index], 3),
        }
        for index in known
        for position in range(len(share))
    ]
    least = max(known, key=lambda index: share[-1, index])
    sentence = say("shares", least=NAMES[least], left=100 * share[-1, least])
    return Picture(sentence, {"shares": page_charts.shares(rows)})


def panels(campaign: Campaign, course: Course | None) -> tuple[dict[str, Spec], dict[str, Any]]:
    """Charts of every parameter's panel, and the sentences under them.

    Parameters
    ----------
    campaign : Campaign
    course : Course or None
        None if the campaign cannot be repeated.

    Returns
    -------
    charts : dict of str to specification
        By id.
    panels : dict of str to dict
        By parameter: the ids of its ``charts`` and the ``sentences`` under them, in three groups.
    """
    charts: dict[str, Spec] = {}
    texts: dict[str, Any] = {}
    # what 95 % of the correlations of unrelated errors keep
    chance = normal_quantile(0.95) / np.sqrt(campaign.summary["runs_done"])
    rows = page_data.correlations(campaign, course.covariance if course else None)
    for index, (name, unit) in enumerate(zip(NAMES, page_data.units(campaign), strict=True)):
        found = page_data.distribution(campaign, index)
        charts[f"panel-{name}"] = page_charts.distribution(found, "", "", unit, _LARGE)
        charts[f"correlation-{name}"] = page_charts.correlation(rows[index], chance)
        own = _courses(course, index, unit) if course else {}
        charts |= own
        texts[name] = {
            "title": f"{style.label(index)} ({name})",
            "charts": [[f"panel-{name}"], [f"correlation-{name}"], list(own)],
            "sentences": [
                _distribution_sentence(campaign, index, unit, found),
                _correlation_sentence(rows[index], chance),
                _course_sentence(course, index, unit),
            ],
        }
    return charts, texts


def _distribution_sentence(campaign: Campaign, index: int, unit: str, found: dict[str, Any]) -> str:
    return say(
        "panel_distribution",
        runs=campaign.summary["runs_done"],
        row=campaign.summary["parameters"][NAMES[index]],
        unit=unit,
        bound=_bound_text(campaign, index),
        in_view=found["bound"] <= found["view"],
    )


def _correlation_sentence(rows: Rows, chance: float) -> str:
    first = rows[0]
    return say(
        "panel_correlation",
        other=first["other"],
        found=_correlation_text(first["errors"]),
        claimed=_correlation_text(first["filter"]),
        outside=sum(abs(row["errors"] or 0.0) > chance for row in rows),
        count=len(rows),
        chance=chance,
    )


def _correlation_text(value: float | None) -> str:
    # adding 0 makes a 0 of what is rounded to -0
    return "–" if value is None else f"{round(value, 2) + 0.0:.2f}".replace("-", "−")


def _courses(course: Course, index: int, unit: str) -> dict[str, Spec]:
    charts = {}
    for number in range(len(course.sigma)):
        sigma, error = course.sigma[number, :, index], course.error[number, :, index]
        if not sigma[-1] > 0.0:
            continue
        ticks = decades(2.0 * sigma[-1], max(sigma.max(), np.abs(error).max()))
        rows = [
            {
                "time_s": float(time),
                "sigma": page_data.rounded(s),
                "error": page_data.rounded(e),
            }
            for time, s, e in zip(course.time_s, sigma, error, strict=True)
        ]
        charts[f"course-{NAMES[index]}-{number + 1}"] = page_charts.course(
            rows, ticks, float(f"{sigma[-1]:.4g}"), f"pass {number + 1}", unit
        )
    return charts


def _course_sentence(course: Course | None, index: int, unit: str) -> str:
    if course is None:
        return say("panel_course", passes=0)
    sigma, error = course.sigma[-1, :, index], course.error[-1, :, index]
    return say(
        "panel_course",
        passes=len(course.sigma),
        run=course.run,
        error=error[-1],
        sigma=sigma[-1],
        unit=unit,
        inside=np.mean(np.abs(error) <= sigma),
        nominal=nominal_coverage(1),
    )
