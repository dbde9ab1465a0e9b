"""Stage `report`: what the campaigns show, in ``results/report.md``.

Usage: ``python -m pipeline.report``, after summarize, compare and figures. The text is composed
from the summaries and comparisons: no result is written here, and every verdict follows from the
numbers by a rule of `pipeline.findings`.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from inscal.parameters import KIND_OF, KINDS, NAMES
from pipeline import findings, store
from pipeline.checks import KIND_KEYS
from pipeline.config import Config, DataError, stage
from pipeline.findings import MAIN, ONE_PASS, Contest, Summary
from pipeline.output import write_text

PATH = Path("results/report.md")

CAMPAIGNS: tuple[str, ...] = (
    "position25-quiet",
    MAIN,
    "position25-noisy",
    "position19-quiet",
    "position19-reference",
    "position19-noisy",
    "position19_equal_time-reference",
    ONE_PASS,
    findings.PAPER_TRUTH,
)
"""Campaigns reported on."""

COMPARISONS: dict[str, str] = {
    findings.EQUAL_POSITION_TIME: "Equal position time",
    findings.EQUAL_TOTAL_TIME: "Equal total time",
}
"""Comparisons reported on, and their headings."""

_BY_NOISE = CAMPAIGNS[:6]
_SAME_TIME_PERCENT = 0.1  # a difference below this is rounding of the position time
_QUADRATIC_TEXTS = {
    "pulse": "acts on pulse rates: 1e-9 s/pulse, which is {:g}e-9 s²/m on specific force",
    "si": "is read at face value: 1e-9 s²/m on specific force",
}
_TRUTH_TEXTS = {
    "normal": "Each run draws its sensor errors from normal distributions of zero mean",
    "uniform": "Each run draws its sensor errors uniformly between minus and plus the limit",
    "fixed": "All runs have the same sensor errors",
}


@dataclass(frozen=True)
class Results:
    """All a report is made of.

    Attributes
    ----------
    summaries : mapping of str to summary
        By name of campaign, `CAMPAIGNS` at least.
    comparisons : mapping of str to comparison
        By the keys of `COMPARISONS`.
    configuration : mapping
        Configuration of campaign `MAIN`.
    """

    summaries: Mapping[str, Summary]
    comparisons: Mapping[str, Summary]
    configuration: Mapping[str, Any]


def collect() -> Results:
    """Read what the report is made of.

    Returns
    -------
    Results

    Raises
    ------
    DataError
        If a summary, a comparison or the store of `MAIN` is missing.
    """
    return Results(
        {name: findings.read_summary(name) for name in CAMPAIGNS},
        {name: findings.read_comparison(name) for name in COMPARISONS},
        store.read(Path("results/runs") / MAIN).attrs["configuration"],
    )


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
    summaries, main = results.summaries, results.summaries[MAIN]
    honest = [name for name in summaries if findings.honesty(summaries[name]) == "honest"]
    others = [name for name in summaries if name not in honest]
    all_checks = findings.checks(summaries)
    lines = [
        f"Requirements met: {sum(check.met for check in all_checks)} of {len(all_checks)}.",
        f"With {_code(MAIN)} all {len(main['parameters'])} errors are within the paper's bounds at "
        f"once in {_joint(main)} of runs.",
        f"The filter's own sigma is honest, by the mean NEES, in {len(honest)} of "
        f"{len(summaries)} campaigns" + (f"; not in {_codes(others)}." if others else "."),
        f"The one-pass campaign {_code(ONE_PASS)} is {findings.honesty(summaries[ONE_PASS])}: mean "
        f"NEES {summaries[ONE_PASS]['nees_mean']:.1f} where "
        f"{findings.degrees_of_freedom(summaries[ONE_PASS])} is right.",
    ]
    lines += [
        f"{heading}: {_verdict(findings.contest(results.comparisons[name]))}"
        for name, heading in COMPARISONS.items()
    ]
    return "## In short\n\n" + _bullets(lines)


def _simulated(results: Results) -> str:
    about, summaries = results.configuration, results.summaries
    schedule, site = about["schedule"], about["site"]
    positions, duration = len(schedule["rotations"]) + 1, schedule["position_duration_s"]
    counts = {summary["runs_done"] for summary in summaries.values()}
    seeds = sorted({summary["seed"] for summary in summaries.values()})
    quadratic = _QUADRATIC_TEXTS[about["sensor"]["quadratic_unit"]]
    lines = [
        f"Schedule {_code(schedule['name'])}: {positions} positions of {duration:g} s, turns at "
        f"{schedule['turn_rate_deg_per_s']:g} °/s, {positions * duration:g} s in all.",
        f"Site: latitude {site['latitude_deg']:g}°, height {site['height_m']:g} m.",
        f"Filter: {about['estimator']['passes']} passes, an update every "
        f"{about['estimator']['update_interval_s']:g} s.",
        f"Runs: {_range(counts)} done per campaign; "
        + (f"seed {seeds[0]} in all of them, " if len(seeds) == 1 else f"seeds {_list(seeds)}. ")
        + (
            "so they share their random draws: they are paired, not independent repetitions."
            if len(seeds) == 1
            else "Campaigns of different seeds are independent."
        ),
        "One unit of quadratic coefficient "
        + quadratic.format(about["sensor"]["accel_pulses_per_m_per_s"])
        + ".",
        f"{_TRUTH_TEXTS[about['truth']['distribution']]}, with the sizes below.",
    ]
    return "\n\n".join(
        (
            "## What was simulated",
            f"The campaign {_code(MAIN)}; the others differ in what their names say.",
            _bullets(lines),
            _kinds_table(results),
            "Noise, of simulation and filter alike:",
            _noise_table(summaries),
        )
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
                _sizes(about["truth"][key]),
                _sizes(about["estimator"]["initial_std"][key]),
                _sizes([limits[name]["bound"] for name in names]),
            )
        )
    return _table(("kind", "unit", "true error", "filter's initial sigma", "bound"), rows, 2)


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
    return _table(headings, rows, 1)


def _checks(summaries: Mapping[str, Summary]) -> str:
    rows = [
        (check.requirement, check.found, "met" if check.met else "**not met**")
        for check in findings.checks(summaries)
    ]
    return "## Requirements\n\n" + _table(("requirement", "found", "verdict"), rows, 3)


def _campaigns(summaries: Mapping[str, Summary]) -> str:
    headings = (
        *("campaign", "runs", "failed", "all bounds met at once", "NEES mean (95 % if honest)"),
        *("filter's sigma", "RMSE/predicted", "farthest from 1", "least within its bound"),
    )
    return "\n\n".join(
        (
            "## All campaigns",
            _table(headings, [_campaign_row(n, s) for n, s in summaries.items()], 1),
            "In parentheses: 95 % intervals; for the NEES, where the mean lies in 95 of 100 "
            "campaigns of an honest filter. Two honest columns next to each other can still hide "
            "a chance deviation: of 27 intervals of 95 %, one or two miss on average.",
        )
    )


def _campaign_row(name: str, summary: Summary) -> tuple[str, ...]:
    ratio, table = findings.ratios(summary), summary["parameters"]
    worst, least = findings.most_deviant(summary), findings.least_within(summary)
    lowest_share = table[least]["share_within_bound"]
    return (
        _code(name),
        str(summary["runs_done"]),
        _failed(summary),
        _joint(summary),
        f"{summary['nees_mean']:.2f} ({summary['nees_lower']:.2f} to {summary['nees_upper']:.2f})",
        findings.honesty(summary),
        f"{min(ratio.values()):.2f} to {max(ratio.values()):.2f}",
        f"{_code(worst)} {ratio[worst]:.2f}",
        f"{_code(least)} {_percent(lowest_share)}" if lowest_share < 1.0 else "none missed",
    )


def _main_table(summary: Summary) -> str:
    headings = (
        *("parameter", "unit", "bias", "RMSE", "predicted", "ratio (95 %)", "p95", "p99.7"),
        *("bound", "within (95 %)"),
    )
    return "\n\n".join(
        (
            f"## {MAIN} in full",
            _table(headings, [_row(n, r) for n, r in summary["parameters"].items()], 2),
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
        _code(name),
        row["unit"],
        *(f"{row[key]:.2g}" for key in ("bias", "rmse", "predicted_std")),
        f"{row['rmse_over_predicted']:.2f} ({low:.2f} to {high:.2f})",
        *(f"{row[key]:.2g}" for key in ("abs_error_p95", "abs_error_p997")),
        f"{row['bound']:g}",
        _share(row[share], row[f"{share}_lower"], row[f"{share}_upper"]),
    )


def _bounds(summaries: Mapping[str, Summary]) -> str:
    missed = {name: findings.missed(summaries[name]) for name in _BY_NOISE}
    parameters = [name for name in NAMES if any(name in table for table in missed.values())]
    fewer = f"fewer than {100 * findings.ENOUGH:g} % of runs"
    parts = ["## Which bounds are missed"]
    if parameters:
        rows = [
            (
                _code(name),
                *(
                    f"{100 * table[name]:.1f}" if name in table else "·"
                    for table in missed.values()
                ),
            )
            for name in parameters
        ]
        parts += [
            f"Percent of runs that miss the bound, where {fewer} meet it:",
            _table(("parameter", *map(_code, missed)), rows, 1),
        ]
    kept = [name for name, table in missed.items() if not table]
    if kept:
        parts.append(f"No bound is met in {fewer} with {_codes(kept)}.")
    parts.append("![Errors against the bounds](figures/errors_against_bounds.png)")
    return "\n\n".join(parts)


def _passes(summaries: Mapping[str, Summary]) -> str:
    one, two = summaries[ONE_PASS], summaries[MAIN]
    names, dof = findings.dishonest_parameters(one), findings.degrees_of_freedom(one)
    low, high = findings.RATIO_BAND
    verdicts = _bullets(
        f"{label} {findings.honesty(summary)}: mean NEES {summary['nees_mean']:.2f} where {dof} is "
        f"right, {summary['nees_mean'] / dof:.2f} times the squared error claimed; the RMSE of "
        f"{len(findings.dishonest_parameters(summary))} of {len(summary['parameters'])} parameters "
        f"is outside {low:.2f} to {high:.2f} times the predicted one, beyond chance; all bounds "
        f"met at once in {_joint(summary)}."
        for label, summary in (("One pass is", one), ("Two passes are", two))
    )
    parts = ["## One pass against two", verdicts]
    if names:
        before, after = one["parameters"], two["parameters"]
        rows = [
            (
                _code(name),
                f"{before[name]['rmse_over_predicted']:.2f}",
                f"{after[name]['rmse_over_predicted']:.2f}",
                f"{before[name]['rmse'] / after[name]['rmse']:.2f}",
            )
            for name in names
        ]
        headings = (
            *("parameter", "RMSE/predicted, one pass", "two passes"),
            "RMSE of one pass over two",
        )
        parts += ["Where the sigma of a single pass is dishonest:", _table(headings, rows, 1)]
    parts += [
        "![RMSE over predicted sigma](figures/predicted_against_empirical.png)",
        "![NEES of both](figures/nees.png)",
    ]
    return "\n\n".join(parts)


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
    duration_a, duration_b = comparison["duration_s"]
    lines = [
        f"{_code(a)} takes {duration_a:g} s, {_code(b)} {duration_b:g} s: "
        f"{_time_text(result.time_saved_percent)}.",
        f"RMSE ratio over {comparison['runs_paired']} paired runs: median {result.median:.2f}, "
        f"from {result.lowest:.2f} to {result.highest:.2f}.",
        f"Significantly worse with 19, by the intervals that hold for all parameters at once: "
        f"{len(result.worse)} of {len(comparison['parameters'])} parameters{_named(result.worse)}.",
        f"Significantly better with 19: {len(result.better)}{_named(result.better)}.",
    ]
    if a in summaries and b in summaries:
        lines.append(
            f"All bounds met at once: {_joint(summaries[a])} of runs with 19, "
            f"{_joint(summaries[b])} with 25."
        )
    return f"{_bullets(lines)}\n\n**{_verdict(result)}**"


def _verdict(result: Contest) -> str:
    """One sentence: who wins, by how much, at what cost."""
    worse, better = len(result.worse), len(result.better)
    balance = (
        f"{worse} parameters significantly worse with 19, {better} better, median RMSE ratio "
        f"{result.median:.2f}"
    )
    cost = f" ({_time_text(result.time_saved_percent)})"
    if worse == better == 0:
        return f"19 and 25 positions cannot be told apart{cost}: median ratio {result.median:.2f}."
    if worse and not better:
        return f"25 positions are better{cost}: {balance}."
    if better and not worse:
        return f"19 positions are better{cost}: {balance}."
    if worse == better:
        return f"neither schedule is better on the whole{cost}: {balance}."
    winner = 25 if worse > better else 19
    return f"{winner} positions are better for most parameters, not for all{cost}: {balance}."


def _time_text(saved: float) -> str:
    if abs(saved) < _SAME_TIME_PERCENT:
        return "the same time"
    return f"19 {'save' if saved > 0 else 'cost'} {abs(saved):.0f} % of the time"


def _failed(summary: Summary) -> str:
    failed = summary["runs_failed"]
    return str(len(failed) if isinstance(failed, list) else failed)


def _joint(summary: Summary) -> str:
    return _share(*(summary[f"joint_share{end}"] for end in ("", "_lower", "_upper")))


def _share(value: float, lower: float, upper: float) -> str:
    return f"{_percent(value)} ({100 * lower:.1f} to {100 * upper:.1f})"


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def _sizes(values: float | Sequence[float]) -> str:
    several = values if isinstance(values, list) else [values]
    return ", ".join(f"{v:g}" for v in (several if len(set(several)) > 1 else several[:1]))


def _range(values: Iterable[float]) -> str:
    ends = sorted(set(values))
    return f"{ends[0]} to {ends[-1]}" if len(ends) > 1 else str(ends[0])


def _list(values: Iterable[object]) -> str:
    return ", ".join(map(str, values))


def _code(text: str) -> str:
    return f"`{text}`"


def _codes(names: Iterable[str]) -> str:
    return _list(map(_code, names))


def _named(names: Sequence[str]) -> str:
    return f" ({_codes(names)})" if names else ""


def _bullets(lines: Iterable[str]) -> str:
    return "\n".join(f"- {line}" for line in lines)


def _table(headings: Sequence[str], rows: Iterable[Sequence[str]], left: int) -> str:
    """Markdown table, its first `left` columns of text and the others of numbers."""
    rule = ["---"] * left + ["---:"] * (len(headings) - left)
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (headings, rule, *rows))


@stage
def main(config: Config) -> None:
    """Write the report."""
    write_text(PATH, report_text(collect()))
    print(PATH)


if __name__ == "__main__":
    main()
