"""The consistency study in words: ``results/consistency.md``, composed from its numbers.

No result is written here: every verdict is a threshold of `pipeline.proof.goals` or an
interval, applied to the numbers handed in.
"""

import math
from collections.abc import Mapping

from inscal.record import OBSERVED
from inscal.statistics import nominal_coverage
from pipeline.proof.goals import (
    PERCENT,
    Study,
    bias_deviation,
    checks,
    earlier_checks,
    nis_consistent,
    outside_of,
    share_text,
    sigma_deviation,
    white,
)
from pipeline.proof.statistics import CONFIDENCE, LAGS, OUTSIDE_BAND
from pipeline.study import verdict
from pipeline.words import markdown as md


def report_text(study: Study) -> str:
    """Compose the report.

    Parameters
    ----------
    study : study

    Returns
    -------
    str
        Markdown.
    """
    sections = (
        "# Consistency of the filter",
        _summary(study),
        _goals(study),
        _estimates(study),
        _coverage(study),
        _bounds(study),
        _innovations(study),
    )
    return "\n\n".join(sections) + "\n"


def _summary(study: Study) -> str:
    seed = f"seed {study['seed']}"
    if study["seed"] != study["usual_seed"]:
        seed += (
            f". The usual seed is {study['usual_seed']}: these runs share no random number with "
            "campaigns of that one"
        )
    noise, differs = study["noise"], study["prior_differs"]
    prior = "as the filter's prior says"
    if differs:
        prior += f", but for {md.codes(differs)}, where the prior is another"
    judged = checks(study)
    missed = [check.claim for check in judged if not check.met]
    earlier = earlier_checks(study)
    goals = f"Goals met: {len(judged) - len(missed)} of {len(judged)}."
    if missed:
        goals += f" Not met: {'; '.join(missed)}."
    if earlier:
        goals += (
            " Of the same goals for the passes that only start the next one: "
            f"{sum(check.met for check in earlier)} of {len(earlier)}."
        )
    return "\n\n".join(
        (
            f"Campaign {md.code(study['campaign'])}: {study['runs_done']} runs of "
            f"{study['positions']} positions of {study['position_duration_s']:g} s, "
            f"{noise['name']} noise, {seed}.",
            f"Each run draws its sensor errors from normal distributions, {prior}. Filter and "
            "simulation share their noise, so this says nothing of errors outside the model.",
            f"**{goals}**",
        )
    )


def _goals(study: Study) -> str:
    verdicts = [*checks(study), *earlier_checks(study)]
    return "\n\n".join(
        (
            "## Goals",
            verdict.table(verdicts, "goal", plain=(verdict.MET,)),
            f"Intervals for all at once are wide enough ({len(study['parameters'])} looks, "
            "Bonferroni) that none of them misses in 95 of 100 campaigns of a perfect filter. "
            "Passes before the last only give the next one its start.",
        )
    )


def _estimates(study: Study) -> str:
    table = study["parameters"]
    headings = (
        *("parameter", "unit", "bias", "bias / its error", "empirical SE", "model SE"),
        *("error of model SE, %", "coverage, %", "bias-eliminated, %"),
    )
    rows = [
        (
            md.code(name),
            row["unit"],
            _with_error(row, "bias"),
            f"{row['bias_over_mcse']:+.2f}",
            _with_error(row, "std"),
            f"{row['predicted_std']:.4g}",
            _with_error(row, "model_error_percent"),
            _with_error(row, "coverage_95_percent", 100.0),
            _with_error(row, "bias_eliminated_coverage_95_percent", 100.0),
        )
        for name, row in table.items()
    ]
    p = study["nees_distribution_p"]
    return "\n\n".join(
        (
            "## Estimates against the filter's own sigma",
            "As Morris, White and Crowther (2019) recommend, each number with its Monte Carlo "
            "standard error in parentheses. Empirical SE: scatter of the estimates about their "
            "mean error; model SE: the sigma the filter claims, the same in every run; coverage: "
            "of 95 % intervals of the filter's sigma.",
            md.table(headings, rows, 2),
            md.bullets(
                (
                    _beyond_text("Bias", [bias_deviation(row) for row in table.values()]),
                    _beyond_text("Model SE", [sigma_deviation(row) for row in table.values()]),
                    f"NEES: mean {study['nees_mean']:.2f}; its distribution over runs "
                    f"{'is' if p >= 1.0 - CONFIDENCE else 'is not'} compatible with chi-square of "
                    f"{len(table)} degrees of freedom (Kolmogorov-Smirnov p = {p:.2g}).",
                )
            ),
        )
    )


def _beyond_text(subject: str, deviations: list[float]) -> str:
    parts = []
    for limit in (2, 3):
        found = sum(deviation > limit for deviation in deviations)
        chance = len(deviations) * (1.0 - nominal_coverage(limit))
        parts.append(f"{found} beyond {limit} standard errors, {chance:.2g} expected by chance")
    return f"{subject}, {len(deviations)} looks: {'; '.join(parts)}."


def _coverage(study: Study) -> str:
    table = study["parameters"]
    rows = []
    for name, row in table.items():
        shares = (f"coverage_{count}_sigma" for count in (1, 2, 3))
        cells = (md.share(row[s], row[f"{s}_lower"], row[f"{s}_upper"]) for s in shares)
        rows.append((md.code(name), *cells))
    headings = [
        f"{count} sigma, {md.percent(nominal_coverage(count))} expected" for count in (1, 2, 3)
    ]
    lines = []
    for count in (1, 2, 3):
        outside = outside_of(table, f"coverage_{count}_sigma", nominal_coverage(count), "")
        lines.append(
            f"{count} sigma: outside the 95 % interval for {len(outside)} of {len(table)} "
            f"parameters{md.named(outside)}, about {0.05 * len(table):.2g} expected by chance."
        )
    return "\n\n".join(
        (
            "## Coverage",
            md.table(("parameter", *headings), rows, 1),
            "In parentheses: 95 % intervals (Wilson).",
            md.bullets(lines),
            "![Zip plot of the 95 % intervals](consistency/zip.png)",
        )
    )


def _bounds(study: Study) -> str:
    table = study["parameters"]
    rows = [
        (
            md.code(name),
            row["unit"],
            f"{row['classical_bound']:.5g}",
            f"{row['bayesian_bound']:.5g}",
            f"{row['rmse']:.5g}",
            f"{row['rmse_over_bound']:.3f} "
            f"({row['rmse_over_bound_lower']:.3f} to {row['rmse_over_bound_upper']:.3f})",
        )
        for name, row in table.items()
    ]
    ratios = [row["rmse_over_bound"] for row in table.values()]
    mean = math.exp(sum(map(math.log, ratios)) / len(ratios))
    outside = outside_of(table, "rmse_over_bound", 1.0, "")
    prior = max(row["classical_bound"] / row["bayesian_bound"] for row in table.values()) - 1.0
    return "\n\n".join(
        (
            "## How much better could any filter be?",
            "The Cramér-Rao bound, by square-root information over the whole record "
            "(`inscal/information.py`): a calculation of its own, with no gain and no covariance. "
            "Classical: unbiased estimates that know nothing beforehand. Bayesian: any estimate, "
            "on average over parameters distributed like those of the campaign.",
            md.table(
                ("parameter", "unit", "classical", "Bayesian", "RMSE", "RMSE / Bayesian (95 %)"),
                rows,
                2,
            ),
            md.bullets(
                (
                    f"RMSE over bound: geometric mean {mean:.3f}, from {min(ratios):.3f} to "
                    f"{max(ratios):.3f}; 1 is outside the 95 % interval for {len(outside)} of "
                    f"{len(table)}{md.named(outside)}, about {0.05 * len(table):.2g} expected by "
                    "chance. A ratio below 1 is chance: the bound holds on average.",
                    f"Without prior knowledge the bound is higher by {_tiny_percent(prior)} at "
                    "most: that is all the prior does for the estimates."
                    if math.isfinite(prior)
                    else "Without prior knowledge some parameters could not be estimated at all.",
                    "The covariance the filter predicts differs from the bound with the filter's "
                    f"own prior by {study['filter_difference']:.1g} sigma at most.",
                )
            ),
        )
    )


def _innovations(study: Study) -> str:
    about = study["innovations"]
    constants, updates = len(study["parameters"]) + 3, about["updates"]
    rows = [
        (
            str(number),
            md.ends((s["first_position"], s["last_position"])),
            f"{s['nis']['mean']:.4f} ({s['nis']['lower']:.4f} to {s['nis']['upper']:.4f})",
            "yes" if nis_consistent(s["nis"]) else "**no**",
            share_text(s["share_beyond_band"]),
            "yes" if white(s["share_beyond_band"]) else "**no**",
        )
        for number, one in enumerate(about["passes"], start=1)
        for s in one["stretches"]
    ]
    headings = (
        *("pass", "positions", f"mean NIS ({PERCENT} if consistent)", "consistent"),
        *(f"beyond the white band ({PERCENT})", "white"),
    )
    parts = [
        "## Innovations",
        f"Of {about['runs']} runs of the campaign, {updates} updates each, divided by their "
        f"predicted covariance: six unit sequences, mean NIS {OBSERVED} and white if the filter is "
        f"optimal. Autocorrelations at lags {LAGS[0]} to {LAGS[-1]} of every run and sequence, "
        f"{md.percent(OUTSIDE_BAND)} of which leave the band of white noise by chance.",
        md.table(headings, rows, 4),
        f"Of {len(rows)} intervals of {PERCENT} each about "
        f"{(1 - CONFIDENCE) * len(rows):.1g} misses by chance in either column.",
        md.bullets(_pass_text(n, one) for n, one in enumerate(about["passes"], start=1)),
        "What theory says to expect. The first pass neglects products of errors: where one of them "
        "shows, innovations exceed their covariance and stay on one side for many updates. A later "
        "pass starts from a result that its record has already "
        f"led to, so its innovations are residuals of a fit: at most {constants} of "
        f"{OBSERVED * updates} units of NIS are missing per run, a mean of "
        f"{OBSERVED - constants / updates:.4f} instead of {OBSERVED}.",
    ]
    if len(about["passes"]) > 1:
        parts.append(_power_text(about))
    parts.append("![NIS over time and autocorrelation](consistency/innovations.png)")
    return "\n\n".join(parts)


def _pass_text(number: int, one: Study) -> str:
    by_position, pooled = one["nis_by_position"], one["pooled"]
    highest = max(range(len(by_position)), key=by_position.__getitem__)
    chance = OUTSIDE_BAND * pooled["count"]
    return (
        f"Pass {number}: largest mean NIS of a position {by_position[highest]:.3f}, position "
        f"{highest + 1}. Autocorrelations averaged over runs: {pooled['beyond']} of "
        f"{pooled['count']} beyond ±{pooled['band']:.5f}, about {chance:.2g} "
        f"expected by chance; largest {pooled['largest']:+.4f}, at lag {pooled['largest_lag']} of "
        f"{pooled['largest_observation']}."
    )


def _power_text(about: Study) -> str:
    first, final = about["first_pass_nees"], about["nees"]
    whole = about["passes"][0]["stretches"][0]["nis"]["mean"]
    text = (
        f"For scale, the same {about['runs']} runs: estimates of the first pass alone have mean "
        f"NEES {first['mean']:.1f} ({first['lower']:.2f} to {first['upper']:.2f} if consistent), "
        f"those of the last {final['mean']:.2f}. The mean NIS of the first pass is off by "
        f"{100 * abs(whole / OBSERVED - 1):.2f} %."
    )
    if not first["lower"] <= first["mean"] <= first["upper"]:
        text += (
            " Errors of the parameters show in innovations only beside the observation noise, "
            f"which makes {100 * about['observation_noise']:.0f} % of their predicted variance "
            "(median): innovations are a weak test of the parameters, no substitute for the NEES."
        )
    return text


def _with_error(row: Mapping[str, float], name: str, factor: float = 1.0) -> str:
    """Write a number to the second digit of its standard error, which follows in parentheses."""
    value, error = factor * row[name], factor * row[f"{name}_mcse"]
    if not error > 0.0:
        return f"{value:.3g} ({error:.2g})"
    digits = max(0, 1 - math.floor(math.log10(error)))
    return f"{value:.{digits}f} ({error:.{digits}f})"


def _tiny_percent(share: float) -> str:
    return f"{100 * share:.2g} %"
