"""Goals of the consistency study, judged by its numbers.

A study is a plain dict, as read from ``results/consistency/consistency.json``.
"""

from collections.abc import Callable, Mapping
from typing import Any

from inscal.record import OBSERVED
from inscal.statistics import nominal_coverage
from pipeline.proof.statistics import CONFIDENCE, OUTSIDE_BAND
from pipeline.study.verdict import Verdict, judged
from pipeline.words import markdown as md

Study = Mapping[str, Any]

NEES_TOLERANCE = 0.6
"""Goal for the mean NEES, about the number of parameters."""

LARGEST_DEVIATION = 3.0
"""Goal for bias and error of the predicted sigma: at most so many Monte Carlo standard errors."""

SAME_COVARIANCE = 1e-6
"""Goal for the filter's covariance against the bound, in sigmas."""

PERCENT = f"{100 * CONFIDENCE:g} %"
"""Confidence of the intervals of NEES, NIS and shares, as text."""


def checks(study: Study) -> list[Verdict]:
    """Judge the estimates and the pass that gives them.

    Parameters
    ----------
    study : study

    Returns
    -------
    list of Verdict
    """
    passes = study["innovations"]["passes"]
    return [
        *_estimate_checks(study),
        *_coverage_checks(study),
        *_bound_checks(study),
        *_innovation_checks(len(passes), passes[-1]),
    ]


def earlier_checks(study: Study) -> list[Verdict]:
    """Judge the passes that only start the next one.

    Parameters
    ----------
    study : study

    Returns
    -------
    list of Verdict
    """
    earlier = study["innovations"]["passes"][:-1]
    return [c for n, one in enumerate(earlier, start=1) for c in _innovation_checks(n, one)]


def _estimate_checks(study: Study) -> list[Verdict]:
    table, mean = study["parameters"], study["nees_mean"]
    count = len(table)
    bias = _largest(table, bias_deviation)
    sigma = _largest(table, sigma_deviation)
    return [
        judged("no run failed", f"{study['runs_failed']} failed", study["runs_failed"] == 0),
        judged(
            f"mean NEES {count} ± {NEES_TOLERANCE:g}",
            f"{mean:.2f}",
            abs(mean - count) <= NEES_TOLERANCE,
        ),
        judged(
            f"mean NEES inside its {PERCENT} interval",
            f"{mean:.2f} in {study['nees_lower']:.2f} to {study['nees_upper']:.2f}",
            study["nees_lower"] <= mean <= study["nees_upper"],
        ),
        judged(
            f"no bias above {LARGEST_DEVIATION:g} standard errors",
            f"largest {bias[1]:.2f} ({md.code(bias[0])})",
            bias[1] <= LARGEST_DEVIATION,
        ),
        judged(
            f"no predicted sigma off by more than {LARGEST_DEVIATION:g} standard errors",
            f"largest {sigma[1]:.2f} ({md.code(sigma[0])})",
            sigma[1] <= LARGEST_DEVIATION,
        ),
    ]


def _coverage_checks(study: Study) -> list[Verdict]:
    table = study["parameters"]
    result = []
    for count in (1, 2, 3):
        name, nominal = f"coverage_{count}_sigma", nominal_coverage(count)
        outside = outside_of(table, name, nominal, "_all")
        shares = [row[name] for row in table.values()]
        result.append(
            judged(
                f"{count} sigma covers {md.percent(nominal)} of runs, by intervals for all at once",
                f"{md.percent(min(shares))} to {md.percent(max(shares))}, "
                f"{len(outside)} outside{md.named(outside)}",
                not outside,
            )
        )
    return result


def _bound_checks(study: Study) -> list[Verdict]:
    table = study["parameters"]
    outside = outside_of(table, "rmse_over_bound", 1.0, "_all")
    ratios = [row["rmse_over_bound"] for row in table.values()]
    return [
        judged(
            f"filter's covariance is the Cramér-Rao bound to {SAME_COVARIANCE:g} sigma",
            f"{study['filter_difference']:.1g}",
            study["filter_difference"] <= SAME_COVARIANCE,
        ),
        judged(
            "RMSE is at the Cramér-Rao bound, by intervals for all at once",
            f"{min(ratios):.3f} to {max(ratios):.3f}, {len(outside)} outside{md.named(outside)}",
            not outside,
        ),
    ]


def _innovation_checks(number: int, one: Study) -> list[Verdict]:
    nis, share = one["stretches"][0]["nis"], one["stretches"][0]["share_beyond_band"]
    return [
        judged(
            f"pass {number}: mean NIS inside its {PERCENT} interval about {OBSERVED}",
            f"{nis['mean']:.4f} in {nis['lower']:.4f} to {nis['upper']:.4f}",
            nis_consistent(nis),
        ),
        judged(
            f"pass {number}: white innovations, {md.percent(OUTSIDE_BAND)} of autocorrelations "
            "beyond their band",
            share_text(share),
            white(share),
        ),
    ]


def bias_deviation(row: Mapping[str, float]) -> float:
    """Size of a bias in Monte Carlo standard errors."""
    return abs(row["bias_over_mcse"])


def sigma_deviation(row: Mapping[str, float]) -> float:
    """Error of a predicted sigma in Monte Carlo standard errors."""
    return abs(row["model_error_percent"] / row["model_error_percent_mcse"])


def _largest(table: Study, deviation: Callable[[Any], float]) -> tuple[str, float]:
    name = max(table, key=lambda key: deviation(table[key]))
    return name, deviation(table[name])


def outside_of(table: Study, name: str, expected: float, suffix: str) -> list[str]:
    """Parameters whose interval, of that suffix, does not contain what is expected."""
    return [
        key
        for key, row in table.items()
        if not row[f"{name}_lower{suffix}"] <= expected <= row[f"{name}_upper{suffix}"]
    ]


def nis_consistent(nis: Mapping[str, float]) -> bool:
    """Whether a mean NIS is in its interval."""
    return nis["lower"] <= nis["mean"] <= nis["upper"]


def white(share: Mapping[str, float]) -> bool:
    """Whether as many autocorrelations are beyond their band as of white noise."""
    return share["lower"] <= OUTSIDE_BAND <= share["upper"]


def share_text(share: Mapping[str, float]) -> str:
    """Write a small share and its interval in percent."""
    ends = f"{100 * share['lower']:.2f} to {100 * share['upper']:.2f}"
    return f"{100 * share['value']:.2f} % ({ends})"
