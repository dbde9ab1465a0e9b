"""The report of the study: its numbers, made ready for the template that has the words."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from inscal.parameters import KINDS, NAMES, members
from pipeline.config.load import position_durations
from pipeline.config.schema import KIND_KEYS
from pipeline.study import assumptions, findings, honesty, verdict
from pipeline.study.findings import ENOUGH, Results, Summary
from pipeline.study.headline import headline
from pipeline.study.honesty import HONEST
from pipeline.study.names import BETTER, COMPARISONS, LEVELS, MAIN, ONE_PASS
from pipeline.words import markdown as md
from pipeline.words.render import render

PATH = Path("results/report.md")
PAGE = Path("results/report.html")

_BY_NOISE = [name for levels in LEVELS.values() for name in levels]


def report_text(results: Results) -> str:
    """Compose the report.

    Parameters
    ----------
    results : Results

    Returns
    -------
    str
        Markdown.
    """
    summaries, about = results.summaries, results.configuration
    checks = findings.checks(summaries)
    views = {name: _campaign(name, summary) for name, summary in summaries.items()}
    not_kept = {name: findings.not_kept(summaries[name]) for name in _BY_NOISE}
    return render(
        findings.TEMPLATES,
        "report.md.jinja",
        enough=f"{100 * ENOUGH:g} %",
        level=f"{100 * honesty.LEVEL:g} %",
        power=f"{100 * honesty.POWER:g} %",
        headline=headline(summaries[MAIN], findings.contest(results.comparisons[BETTER])),
        requirements=verdict.table(checks, "requirement", plain=(verdict.MET,)),
        requirements_met=sum(check.met for check in checks),
        requirements_count=len(checks),
        assumptions=assumptions.rows(results.disturbances) if results.disturbances else [],
        assumption_headings=assumptions.HEADINGS,
        disturbance=results.disturbances and results.disturbances["disturbance"],
        campaigns=views,
        main=views[MAIN],
        one_pass=views[ONE_PASS],
        by_noise=[views[name] for name in _BY_NOISE],
        not_honest=[view for view in views.values() if view["honesty"] != HONEST],
        contests=[_contest(heading, name, results) for name, heading in COMPARISONS.items()],
        schedule=_schedule(about["schedule"]),
        site=about["site"],
        estimator=about["estimator"],
        sensor=about["sensor"],
        truth=about["truth"],
        run_counts=[summary["runs_done"] for summary in summaries.values()],
        seeds=sorted({summary["seed"] for summary in summaries.values()}),
        kinds=_kind_rows(results),
        noises=_noise_rows(summaries),
        campaign_rows=[_campaign_row(name, summary) for name, summary in summaries.items()],
        parameter_rows=[_row(n, row) for n, row in summaries[MAIN]["parameters"].items()],
        missed_headings=("parameter", *map(md.code, not_kept)),
        missed_rows=_missed_rows(summaries, not_kept),
        all_kept=[name for name, words in not_kept.items() if not words],
        passes_rows=_passes_rows(summaries[ONE_PASS], summaries[MAIN]),
    )


def _campaign(name: str, summary: Summary) -> dict[str, Any]:
    runs, dof = summary["runs_done"], findings.degrees_of_freedom(summary)
    return {
        "name": name,
        "runs_done": runs,
        "runs_failed": summary["runs_failed"],
        "count": len(summary["parameters"]),
        "bounds_word": findings.bounds_word(summary),
        "joint": findings.joint_text(summary),
        "honesty": honesty.honesty(summary),
        "disturbance": summary.get("disturbance"),
        "sources": len(summary.get("disturbances", ())),
        "sight": honesty.sight(runs, dof),
        "nees_mean": summary["nees_mean"],
        "degrees_of_freedom": dof,
        "nees_factor": summary["nees_mean"] / dof,
        "ratio_limits": honesty.ratio_limits(runs, dof),
        "refuted": len(honesty.refuted(summary)),
    }


def _schedule(schedule: Mapping[str, Any]) -> dict[str, Any]:
    durations = position_durations(schedule)
    return {
        "name": schedule["name"],
        "positions": len(durations),
        "position_s": md.spread(durations),
        "turn_rate": schedule["turn_rate_deg_per_s"],
        "total_s": sum(durations),
    }


def _contest(heading: str, name: str, results: Results) -> dict[str, Any]:
    comparison = results.comparisons[name]
    result = findings.contest(comparison)
    return {
        **vars(result),
        "heading": heading,
        "verdict": findings.contest_verdict(result),
        "time": findings.time_text(result),
        "seconds": comparison["duration_s"],
        "pairs": comparison["runs_paired"],
        "count": len(comparison["parameters"]),
    }


def _kind_rows(results: Results) -> list[tuple[str, ...]]:
    about, limits = results.configuration, results.summaries[MAIN]["parameters"]
    rows: list[tuple[str, ...]] = []
    for kind, key in KIND_KEYS.items():
        own = [limits[NAMES[index]]["bound"] for index in members(kind)]
        rows.append(
            (
                kind.replace("_", " "),
                KINDS[kind].unit,
                md.sizes(about["truth"][key]),
                md.sizes(about["estimator"]["initial_std"][key]),
                md.sizes(own),
            )
        )
    return rows


def _noise_rows(summaries: Mapping[str, Summary]) -> list[tuple[str, ...]]:
    levels = {summary["noise"]["name"]: summary["noise"] for summary in summaries.values()}
    return [
        (
            name,
            f"{noise['gyro_angle_random_walk_deg_per_sqrt_h']:g}",
            f"{noise['accel_white_noise_ug_per_sqrt_hz']:g}",
            f"{noise['velocity_observation_m_per_s']:g}",
            f"{noise['position_observation_m']:g}",
        )
        for name, noise in levels.items()
    ]


def _campaign_row(name: str, summary: Summary) -> tuple[str, ...]:
    ratio, table = honesty.ratios(summary), summary["parameters"]
    worst, least = honesty.most_deviant(summary), findings.least_within(summary)
    lowest_share = table[least]["share_within_bound"]
    low, high = honesty.nees_limits(summary["runs_done"], len(ratio))
    return (
        md.code(name),
        str(summary["runs_done"]),
        str(summary["runs_failed"]),
        md.ends(map(int, summary["passes_taken"])),
        findings.joint_text(summary),
        f"{md.number(summary['nees_mean'])} ({low:.2f} to {high:.2f})",
        honesty.honesty(summary),
        f"{min(ratio.values()):.2f} to {max(ratio.values()):.2f}",
        f"{md.code(worst)} {ratio[worst]:.2f}",
        f"{md.code(least)} {md.percent(lowest_share)}" if lowest_share < 1.0 else "none missed",
    )


def _row(name: str, row: Mapping[str, Any]) -> tuple[str, ...]:
    low, high = findings.ratio_interval(row) if row["predicted_std"] > 0.0 else (float("nan"),) * 2
    share = "share_within_bound"
    return (
        md.code(name),
        row["unit"],
        *(f"{row[key]:.2g}" for key in ("bias", "rmse", "predicted_std")),
        f"{row['rmse_over_predicted']:.2f} ({low:.2f} to {high:.2f})",
        *(f"{row[key]:.2g}" for key in ("abs_error_p95", "abs_error_p997")),
        f"{row['bound']:g}",
        md.share(row[share], row[f"{share}_lower"], row[f"{share}_upper"]),
    )


def _missed_rows(
    summaries: Mapping[str, Summary], not_kept: Mapping[str, Mapping[str, str]]
) -> list[tuple[str, ...]]:
    def cell(campaign: str, name: str) -> str:
        word = not_kept[campaign].get(name)
        share = summaries[campaign]["parameters"][name]["share_within_bound"]
        beyond = f"{100.0 * (1.0 - share):.1f}"
        return {None: "·", verdict.UNDECIDED: f"{beyond}?"}.get(word, beyond)

    return [
        (md.code(name), *(cell(campaign, name) for campaign in not_kept))
        for name in NAMES
        if any(name in words for words in not_kept.values())
    ]


def _passes_rows(one_pass: Summary, two_passes: Summary) -> list[tuple[str, ...]]:
    one, two = one_pass["parameters"], two_passes["parameters"]
    return [
        (
            md.code(name),
            f"{one[name]['rmse_over_predicted']:.2f}",
            f"{two[name]['rmse_over_predicted']:.2f}",
            f"{one[name]['rmse'] / two[name]['rmse']:.2f}",
        )
        for name in honesty.refuted(one_pass)
    ]
