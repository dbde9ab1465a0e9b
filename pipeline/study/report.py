"""The report of the study in words, composed from its numbers."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from inscal.parameters import KIND_OF, KINDS, NAMES
from pipeline.config.schema import KIND_KEYS
from pipeline.study import findings
from pipeline.study.findings import Results, Summary
from pipeline.study.names import COMPARISONS, LEVELS, MAIN, MAIN_LEVELS, ONE_PASS
from pipeline.words import markdown as md

PATH = Path("results/report.md")
PAGE = Path("results/report.html")

_BY_NOISE = [name for level in LEVELS.values() for name in level]
_QUADRATIC_TEXTS = {
    "pulse": "acts on pulse rates: 1e-9 s/pulse, which is {:g}e-9 s²/m on specific force",
    "si": "is read at face value: 1e-9 s²/m on specific force",
}
_TRUTH_TEXTS = {
    "normal": "Each run draws its sensor errors from normal distributions of zero mean",
    "uniform": "Each run draws its sensor errors uniformly between minus and plus the limit",
    "fixed": "All runs have the same sensor errors",
}


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
    sections = (
        "# Calibration by Monte Carlo: what the campaigns show",
        _in_short(results),
        _simulated(results),
        _checks(results.summaries),
        _campaigns(results.summaries),
        _main_table(results.summaries[MAIN]),
        _bounds(results.summaries),
        _passes(results.summaries),
        _schedules(results),
    )
    return "\n\n".join(sections) + "\n"


def _in_short(results: Results) -> str:
    summaries, one = results.summaries, results.summaries[ONE_PASS]
    honest = [name for name in summaries if findings.honesty(summaries[name]) == "honest"]
    others = [name for name in summaries if name not in honest]
    all_checks = findings.checks(summaries)
    lines = [
        f"Requirements met: {sum(check.met for check in all_checks)} of {len(all_checks)}.",
        *(_bounds_met(name, summaries[name]) for name in MAIN_LEVELS),
        f"By the mean NEES the filter's own sigma is honest in {len(honest)} of {len(summaries)} "
        "campaigns" + (f", not in {md.codes(others)}." if others else "."),
        f"A single pass is {findings.honesty(one)}: mean NEES {one['nees_mean']:.1f} where "
        f"{findings.degrees_of_freedom(one)} is right.",
    ]
    lines += [
        f"{heading}: {findings.contest_verdict(findings.contest(results.comparisons[name]))}"
        for name, heading in COMPARISONS.items()
    ]
    return "## In short\n\n" + md.bullets(lines)


def _bounds_met(name: str, summary: Summary) -> str:
    verdict = "met" if summary["joint_share"] >= findings.ENOUGH else "not met"
    return (
        f"{md.code(name)}: the paper's bounds are {verdict}, all {len(summary['parameters'])} at "
        f"once in {_joint(summary)} of runs, {100 * findings.ENOUGH:g} % being asked for."
    )


def _simulated(results: Results) -> str:
    about, summaries = results.configuration, results.summaries
    schedule, site = about["schedule"], about["site"]
    positions, duration = len(schedule["rotations"]) + 1, schedule["position_duration_s"]
    counts = {summary["runs_done"] for summary in summaries.values()}
    quadratic = _QUADRATIC_TEXTS[about["sensor"]["quadratic_unit"]]
    lines = [
        f"Schedule {md.code(schedule['name'])}: {positions} positions of {duration:g} s, turns at "
        f"{schedule['turn_rate_deg_per_s']:g} °/s, {positions * duration:g} s in all.",
        f"Site: latitude {site['latitude_deg']:g}°, height {site['height_m']:g} m.",
        f"Filter: {about['estimator']['passes']} passes, an update every "
        f"{about['estimator']['update_interval_s']:g} s.",
        f"Runs: {md.ends(counts)} done per campaign; {_seeds_text(summaries)}",
        "One unit of quadratic coefficient "
        + quadratic.format(about["sensor"]["accel_pulses_per_m_per_s"])
        + ".",
        f"{_TRUTH_TEXTS[about['truth']['distribution']]}, with the sizes below.",
    ]
    return "\n\n".join(
        (
            "## What was simulated",
            f"The campaign {md.code(MAIN)}; the others differ in what their names say.",
            md.bullets(lines),
            _kinds_table(results),
            "Noise, of simulation and filter alike: what follows holds where the filter knows its "
            "noise, and says nothing of errors outside the model.",
            _noise_table(summaries),
        )
    )


def _seeds_text(summaries: Mapping[str, Summary]) -> str:
    seeds = sorted({summary["seed"] for summary in summaries.values()})
    if len(seeds) > 1:
        return f"seeds {md.listed(seeds)}. Campaigns of one seed share their random draws."
    return (
        f"seed {seeds[0]} in all of them. They share their random draws: they can be paired, and "
        "are no independent repetitions of each other."
    )


def _kinds_table(results: Results) -> str:
    about = results.configuration
    limits = results.summaries[MAIN]["parameters"]
    rows = []
    for kind, key in KIND_KEYS.items():
        names = [name for name, other in zip(NAMES, KIND_OF, strict=True) if other == kind]
        rows.append(
            (
                kind.replace("_", " "),
                KINDS[kind].unit,
                md.sizes(about["truth"][key]),
                md.sizes(about["estimator"]["initial_std"][key]),
                md.sizes([limits[name]["bound"] for name in names]),
            )
        )
    return md.table(
        ("kind", "unit", "true error (or its size)", "filter's initial sigma", "bound"), rows, 2
    )


def _noise_table(summaries: Mapping[str, Summary]) -> str:
    levels = {summary["noise"]["name"]: summary["noise"] for summary in summaries.values()}
    rows = [
        (
            name,
            f"{noise['gyro_angle_random_walk_deg_per_sqrt_h']:g}",
            f"{noise['accel_white_noise_ug_per_sqrt_hz']:g}",
            f"{noise['velocity_observation_m_per_s']:g}",
            f"{noise['position_observation_m']:g}",
        )
        for name, noise in levels.items()
    ]
    headings = ("noise", "gyro, °/√h", "accel., µg/√Hz", "velocity, m/s", "position, m")
    return md.table(headings, rows, 1)


def _checks(summaries: Mapping[str, Summary]) -> str:
    rows = [
        (check.requirement, check.found, "met" if check.met else "**not met**")
        for check in findings.checks(summaries)
    ]
    return "## Requirements\n\n" + md.table(("requirement", "found", "verdict"), rows, 3)


def _campaigns(summaries: Mapping[str, Summary]) -> str:
    headings = (
        *("campaign", "runs", "failed", "all bounds met at once", "NEES mean (95 % if honest)"),
        *("filter's sigma", "RMSE/predicted", "farthest from 1", "least within its bound"),
    )
    return "\n\n".join(
        (
            "## All campaigns",
            md.table(headings, [_campaign_row(n, s) for n, s in summaries.items()], 1),
            "In parentheses: 95 % intervals; for the NEES, where the mean lies in 95 of 100 "
            "campaigns of an honest filter. The ratio farthest from 1 is an extreme of all "
            "parameters: of as many 95 % intervals some miss by chance alone.",
        )
    )


def _campaign_row(name: str, summary: Summary) -> tuple[str, ...]:
    ratio, table = findings.ratios(summary), summary["parameters"]
    worst, least = findings.most_deviant(summary), findings.least_within(summary)
    lowest_share = table[least]["share_within_bound"]
    return (
        md.code(name),
        str(summary["runs_done"]),
        str(summary["runs_failed"]),
        _joint(summary),
        f"{summary['nees_mean']:.2f} ({summary['nees_lower']:.2f} to {summary['nees_upper']:.2f})",
        findings.honesty(summary),
        f"{min(ratio.values()):.2f} to {max(ratio.values()):.2f}",
        f"{md.code(worst)} {ratio[worst]:.2f}",
        f"{md.code(least)} {md.percent(lowest_share)}" if lowest_share < 1.0 else "none missed",
    )


def _main_table(summary: Summary) -> str:
    headings = (
        *("parameter", "unit", "bias", "RMSE", "predicted", "ratio (95 %)", "p95", "p99.7"),
        *("bound", "within (95 %)"),
    )
    return "\n\n".join(
        (
            f"## {MAIN} in full",
            md.table(headings, [_row(n, r) for n, r in summary["parameters"].items()], 2),
            "Ratio: RMSE over the sigma the filter claims. p95 and p99.7: quantiles of |error|; "
            f"with {summary['runs_done']} runs the latter is near the largest error of all and "
            "known no better than that.",
            "![Histograms of the errors](figures/error_distributions.png)",
        )
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


def _bounds(summaries: Mapping[str, Summary]) -> str:
    missed = {name: findings.missed(summaries[name]) for name in _BY_NOISE}
    parameters = [name for name in NAMES if any(name in table for table in missed.values())]
    parts = ["## Which bounds are missed"]
    if parameters:
        parts += [
            f"Percent of runs beyond the bound, where more than {100 - 100 * findings.ENOUGH:g} % "
            "are (a dot where not):",
            _missed_table(parameters, missed),
        ]
    kept = [name for name, table in missed.items() if not table]
    if kept:
        share = f"{100 * findings.ENOUGH:g} %"
        parts.append(f"Every bound is met in at least {share} of runs of {md.codes(kept)}.")
    parts.append("![Errors against the bounds](figures/errors_against_bounds.png)")
    return "\n\n".join(parts)


def _missed_table(parameters: list[str], missed: Mapping[str, Mapping[str, float]]) -> str:
    rows = [
        (
            md.code(name),
            *(f"{100 * table[name]:.1f}" if name in table else "·" for table in missed.values()),
        )
        for name in parameters
    ]
    return md.table(("parameter", *map(md.code, missed)), rows, 1)


def _passes(summaries: Mapping[str, Summary]) -> str:
    one, two = summaries[ONE_PASS], summaries[MAIN]
    names = findings.dishonest_parameters(one)
    parts = [
        "## One pass against two",
        md.bullets((_pass_text("One pass is", one), _pass_text("Two passes are", two))),
    ]
    if names:
        parts += [
            "Where the sigma of a single pass is dishonest:",
            _passes_table(names, one["parameters"], two["parameters"]),
        ]
    parts += [
        "![RMSE over predicted sigma](figures/predicted_against_empirical.png)",
        "![NEES of both](figures/nees.png)",
    ]
    return "\n\n".join(parts)


def _pass_text(subject: str, summary: Summary) -> str:
    dof, (low, high) = findings.degrees_of_freedom(summary), findings.RATIO_BAND
    outside = len(findings.dishonest_parameters(summary))
    return (
        f"{subject} {findings.honesty(summary)}: mean NEES {summary['nees_mean']:.2f} where {dof} "
        f"is right, {summary['nees_mean'] / dof:.2f} times the squared error claimed. RMSE over "
        f"predicted sigma lies outside {low:.2f} to {high:.2f}, with its whole 95 % interval, for "
        f"{outside} of {len(summary['parameters'])} parameters. All bounds are met at once in "
        f"{_joint(summary)} of runs."
    )


def _passes_table(names: list[str], one: Summary, two: Summary) -> str:
    headings = ("parameter", "RMSE/predicted, one pass", "two passes", "RMSE of one pass over two")
    rows = [
        (
            md.code(name),
            f"{one[name]['rmse_over_predicted']:.2f}",
            f"{two[name]['rmse_over_predicted']:.2f}",
            f"{one[name]['rmse'] / two[name]['rmse']:.2f}",
        )
        for name in names
    ]
    return md.table(headings, rows, 1)


def _schedules(results: Results) -> str:
    parts = ["## 19 positions against 25"]
    for name, heading in COMPARISONS.items():
        comparison = results.comparisons[name]
        parts.append(f"### {heading}")
        parts.append(_contest_text(comparison, results.summaries))
    parts.append("![RMSE of 19 positions over that of 25](figures/schedule_comparison.png)")
    return "\n\n".join(parts)


def _contest_text(comparison: Summary, summaries: Mapping[str, Summary]) -> str:
    a, b, result = comparison["a"], comparison["b"], findings.contest(comparison)
    seconds_a, seconds_b = comparison["duration_s"]
    lines = [
        f"{md.code(a)} takes {seconds_a:g} s, {md.code(b)} {seconds_b:g} s: "
        f"{findings.time_text(result)}.",
        f"RMSE ratio over {comparison['runs_paired']} paired runs: median {result.median:.2f}, "
        f"from {result.lowest:.2f} to {result.highest:.2f}.",
        "Significantly worse with 19, by the intervals that hold for all parameters at once: "
        f"{len(result.worse)} of {len(comparison['parameters'])}{md.named(result.worse)}.",
        f"Significantly better with 19: {len(result.better)}{md.named(result.better)}.",
    ]
    if a in summaries and b in summaries:
        lines.append(
            f"All bounds met at once: {_joint(summaries[a])} of runs with 19, "
            f"{_joint(summaries[b])} with 25."
        )
    return f"{md.bullets(lines)}\n\n**{findings.contest_verdict(result)}**"


def _joint(summary: Summary) -> str:
    return md.share(*(summary[f"joint_share{end}"] for end in ("", "_lower", "_upper")))
