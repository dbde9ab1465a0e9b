"""Sections of the HTML page that show one campaign, or several beside each other."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from inscal.observability import STATES
from inscal.parameters import KIND_OF, KINDS, NAMES
from inscal.statistics import nominal_coverage
from pipeline.charts import style
from pipeline.config.schema import Config
from pipeline.page import charts as page_charts
from pipeline.page import data as page_data
from pipeline.page.charts import Rows, Spec
from pipeline.page.data import Campaign, Course
from pipeline.page.parts import Picture, Section
from pipeline.study import findings
from pipeline.study import observability as observe
from pipeline.study.claims import Claims
from pipeline.study.findings import ENOUGH, RATIO_BAND, Summary
from pipeline.words import markdown as md

_SMALL, _LARGE = 110, 150  # heights of histograms, in pixels
_CHANCE = 1.96  # standard errors that 95 % of the correlations of unrelated errors stay within
_FACTOR = 2.5758  # sigmas that hold the share ENOUGH of normal errors
_PLAIN = 1e4  # numbers from which on powers of ten are easier to read
_STAIRS = ("dwells alone", "turns on gyros and lever arms")


def distributions(campaign: Campaign) -> Section:
    """Make the section of all parameters' histograms."""
    table = campaign.summary["parameters"]
    charts, beyond_view = {}, 0
    for index in style.ORDER:
        name = NAMES[index]
        found = page_data.distribution(campaign, index)
        beyond_view += found["bound"] > found["view"]
        below = f"bound ±{found['bound']:g}{_sigmas(campaign, index)}"
        charts[f"distribution-{name}"] = page_charts.distribution(
            found, style.label(index), below, campaign.units[index], _SMALL
        )
    least = findings.least_within(campaign.summary)
    worst = table[least]
    missed = (
        f"the bound most often missed is {md.code(least)}'s, in "
        f"{md.percent(1.0 - worst['share_within_bound'])} of runs"
        if worst["share_within_bound"] < 1.0
        else "no error is beyond its bound"
    )
    sentence = (
        f"Errors of {campaign.summary['runs_done']} runs (bars) with the normal curve that the "
        f"filter predicts and the bounds (dashed): {missed}, and {beyond_view} of {len(table)} "
        "bounds lie so far out that their picture does not reach them."
    )
    return Section(
        "distributions",
        "How the errors are distributed",
        pictures=[Picture(sentence, charts, "small")],
    )


def _sigmas(campaign: Campaign, index: int) -> str:
    sigma = campaign.predicted_std[index]
    bound = campaign.summary["parameters"][NAMES[index]]["bound"]
    return f" is {bound / sigma:.3g} sigma" if sigma > 0.0 else ", not estimated"


def sigmas(campaigns: Sequence[Campaign]) -> Section:
    """Make the section of predicted against empirical sigma."""
    rows: list[dict[str, Any]] = []
    for campaign in campaigns:
        table = campaign.summary["parameters"]
        for name, ratio in findings.ratios(campaign.summary).items():
            lower, upper = map(page_data.rounded, findings.ratio_interval(table[name]))
            row = {"parameter": name, "campaign": campaign.name, "ratio": page_data.rounded(ratio)}
            rows.append(row | {"lower": lower, "upper": upper})
    low, high = RATIO_BAND
    outside = [
        f"{len(findings.dishonest_parameters(c.summary))} of "
        f"{findings.degrees_of_freedom(c.summary)} parameters of {md.code(c.name)}"
        for c in campaigns
    ]
    sentence = (
        "RMSE over the sigma the filter predicts, with 95 % intervals: wholly outside the band "
        f"from {low:.2f} to {high:.2f} of an honest sigma lie those of {', '.join(outside)}."
    )
    spec = page_charts.ratios(rows, [campaign.name for campaign in campaigns])
    return Section(
        "sigma", "Predicted against empirical sigma", pictures=[Picture(sentence, {"ratios": spec})]
    )


def nees(campaigns: Sequence[Campaign]) -> Section:
    """Make the section of the NEES."""
    charts, texts = {}, []
    for number, campaign in enumerate(campaigns):
        summary, found = campaign.summary, page_data.nees_histogram(campaign)
        mean, dof = summary["nees_mean"], findings.degrees_of_freedom(summary)
        mean_text = f"mean {mean:.2f}" if mean < _PLAIN else f"mean {mean:.2g}"
        below = f"; {found['beyond']} runs beyond {found['view']:g}" if found["beyond"] else ""
        charts[f"nees-{number}"] = page_charts.nees(found, campaign.name, mean_text + below)
        texts.append(
            f"{md.code(campaign.name)} is {findings.honesty(summary)}, its {mean_text} where "
            f"{dof} is right and {summary['nees_lower']:.2f} to {summary['nees_upper']:.2f} "
            "is chance"
        )
    sentence = (
        "NEES of every run (bars) against the chi-square curve of an honest filter: "
        f"{'; '.join(texts)}."
    )
    return Section("nees", "NEES", pictures=[Picture(sentence, charts, "small wide")])


def contest_section(title: str, comparisons: Sequence[tuple[str, Summary]]) -> Section:
    """Make the section of paired comparisons, each with its heading."""
    pictures = []
    for number, (heading, comparison) in enumerate(comparisons):
        rows = []
        for name, row in comparison["parameters"].items():
            lower, upper = row["simultaneous_lower"], row["simultaneous_upper"]
            word = "worse" if lower > 1.0 else "better" if upper < 1.0 else "no difference shown"
            numbers = {"ratio": row["ratio"], "lower": lower, "upper": upper}
            numbers["predicted"] = row["predicted_ratio"]
            rounded = {key: page_data.rounded(value) for key, value in numbers.items()}
            rows.append({"parameter": name, "word": word, **rounded})
        result = findings.contest(comparison)
        spec = page_charts.contest(
            rows, heading, [f"RMSE of {result.a}", f"over RMSE of {result.b}"]
        )
        verdict = findings.contest_verdict(result)
        sentence = (
            f"RMSE of {comparison['runs_paired']} paired runs, pink marks being the ratio that the "
            f"filters predict: {verdict}"
        )
        pictures.append(Picture(sentence, {f"contest-{number}": spec}))
    return Section("schedules", title, pictures=pictures)


def convergence(campaign: Campaign, course: Course) -> Section:
    """Make the section of how the predicted sigmas fall over time, in the last pass."""
    table = campaign.summary["parameters"]
    bound = np.array([table[name]["bound"] for name in NAMES])
    share = course.sigma[-1] / bound
    needed = 1.0 / _FACTOR
    charts = {}
    for kind in KINDS:
        own = [i for i, other in enumerate(KIND_OF) if other == kind and share[-1, i] > 0.0]
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
            title = kind.replace("_", " ")
            charts[f"convergence-{kind}"] = page_charts.convergence(rows, needed, title)
    good = int(((share[-1] <= needed) & (share[-1] > 0.0)).sum())
    modelled = int((share[-1] > 0.0).sum())
    sentence = (
        "Sigma that the filter predicts over the bound, a line per parameter, in its last pass: "
        f"at the end {good} of {modelled} are below {needed:.2f} (dashed), where normal errors "
        f"keep their bound in {100 * ENOUGH:g} % of runs."
    )
    return Section(
        "convergence",
        "How the sigmas converge",
        pictures=[Picture(sentence, charts, "small")],
        lines=() if course.as_stored else (_OTHER_VERSION,),
    )


_OTHER_VERSION = (
    "The courses over time come from this version of the code, which does not repeat the run of "
    "the store: the campaign was made by another version."
)


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
        where = f" from position {full[0] + 1} on" if len(full) else " at the end"
        lasts.append(f"{counts[-1]} of {STATES}{where} with {name}")
    series = list(_STAIRS)
    ranks = _paper_ranks(config, wing) if wing else ()
    if ranks:
        series.append("the paper's Table 2")
        rows += [{"by": series[-1], "position": n + 1, "rank": r} for n, r in enumerate(ranks)]
        lasts.append(f"{ranks[-1]} in the paper")
    stairs = Picture(
        f"Rank of the stripped observability matrix, position by position: {', '.join(lasts)}.",
        {"ranks": page_charts.ranks(rows, series, STATES)},
    )
    return Section(
        "observability",
        "What each position makes observable",
        pictures=(stairs, _share_picture(page_data.sigma_share(config))),
    )


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
    sentence = (
        "Predicted sigma over the initial one after each position, dark being little known and "
        f"light well known: the least gained is {md.code(NAMES[least])}, with "
        f"{100 * share[-1, least]:.2g} % of its initial sigma left."
    )
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
    count = campaign.summary["runs_done"]
    chance = _CHANCE / np.sqrt(count)
    rows = page_data.correlations(campaign, course.covariance if course else None)
    for index, (name, unit) in enumerate(zip(NAMES, campaign.units, strict=True)):
        found = page_data.distribution(campaign, index)
        charts[f"panel-{name}"] = page_charts.distribution(found, "", "", unit, _LARGE)
        charts[f"correlation-{name}"] = page_charts.correlation(rows[index], chance)
        own = _courses(course, index, unit) if course else {}
        charts |= own
        texts[name] = {
            "title": f"{style.label(index)} ({name})",
            "charts": [[f"panel-{name}"], [f"correlation-{name}"], list(own)],
            "sentences": [
                _distribution_sentence(campaign, index, found),
                _correlation_sentence(rows[index], chance),
                _course_sentence(course, index, unit),
            ],
        }
    return charts, texts


def _distribution_sentence(campaign: Campaign, index: int, found: dict[str, Any]) -> str:
    row = campaign.summary["parameters"][NAMES[index]]
    view = "" if found["bound"] <= found["view"] else ", outside the picture"
    return (
        f"Errors of {campaign.summary['runs_done']} runs (bars) and the normal curve that the "
        f"filter predicts: RMSE {row['rmse']:.3g} {campaign.units[index]}, predicted sigma "
        f"{row['predicted_std']:.3g}; the bound ±{row['bound']:g}{_sigmas(campaign, index)}{view}."
    )


def _correlation_sentence(rows: Rows, chance: float) -> str:
    first = rows[0]
    found, claimed = (_correlation_text(first[key]) for key in ("errors", "filter"))
    outside = sum(abs(row["errors"] or 0.0) > chance for row in rows)
    return (
        "Correlation with the other parameters' errors (bars), beside what the filter's covariance "
        f"claims (marks): strongest with {first['other']}, {found} found and {claimed} claimed; "
        f"{outside} of {len(rows)} are beyond ±{chance:.2f} (shaded), which 95 % of unrelated "
        "errors keep."
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
        ticks = page_charts.decades(2.0 * sigma[-1], max(sigma.max(), np.abs(error).max()))
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
        return "The course over time is left out: the campaign cannot be repeated."
    sigma, error = course.sigma[-1, :, index], course.error[-1, :, index]
    if not sigma[-1] > 0.0:
        return "The filter does not estimate this parameter: it has no course."
    several = "; the last step takes back the prior that a later pass counts again"
    once = several if len(course.sigma) > 1 else ""
    inside = np.mean(np.abs(error) <= sigma)
    return (
        f"Error of run {course.run} (line) within plus and minus the predicted sigma (shaded), "
        f"pass by pass, up on a symmetric logarithmic scale{once}: it ends at {error[-1]:.2g} "
        f"{unit} where sigma is {sigma[-1]:.2g}, and inside for {100 * inside:.0f} % of the last "
        f"pass (of many runs, {100 * nominal_coverage(1):.0f} % are at any time)."
    )
