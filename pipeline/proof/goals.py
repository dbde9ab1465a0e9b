"""Goals of the consistency study, judged by its numbers.

A study is a plain dict, as read from ``results/consistency/consistency.json``.
"""

from collections.abc import Mapping
from typing import Any

from inscal import chance
from inscal.parameters import COUNT
from inscal.statistics import nominal_coverage
from pipeline.proof.looks import OUTSIDE_BAND, Innovations, at_innovations, level, missed
from pipeline.study.honesty import BLIND, POWER
from pipeline.study.verdict import MET, NOT_MET, UNDECIDED, Verdict, judged
from pipeline.words import markdown as md

Study = Mapping[str, Any]

SAME_COVARIANCE = 1e-6
"""Goal for the filter's covariance against the bound, in sigmas."""


def checks(study: Study) -> list[Verdict]:
    """Judge the estimates and the pass that gives them.

    Parameters
    ----------
    study : study

    Returns
    -------
    list of Verdict
        What chance could not have shown is not met. What is not refuted is met if the runs are
        enough to see an error, and else cannot be judged.
    """
    passes = study["innovations"]["passes"]
    return [
        judged("no run failed", f"{study['runs_failed']} failed", study["runs_failed"] == 0),
        *_estimate_checks(study),
        *_bound_checks(study),
        *_innovation_checks(study, len(passes)),
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
    passes = len(study["innovations"]["passes"])
    return [c for number in range(1, passes) for c in _innovation_checks(study, number)]


def one_seen(study: Study) -> float:
    """Smallest lack of one sigma that the runs show in `POWER` of campaigns."""
    return chance.smallest_seen(study["runs_done"], level("rmse_over_bound"), POWER)


def all_seen(study: Study) -> float:
    """Smallest lack of all sigmas alike that the runs show in `POWER` of campaigns."""
    return chance.smallest_seen(study["runs_done"] * COUNT, level("nees"), POWER)


def _by_chance(study: Study, contradicted: bool, claim: str, found: str) -> Verdict:
    """Judge what chance can show: refuted, not refuted, or not to be judged by so few runs."""
    seen = one_seen(study) <= BLIND
    return Verdict(claim, found, NOT_MET if contradicted else MET if seen else UNDECIDED)


def _look(study: Study, goal: str, claim: str, found: str) -> Verdict:
    look = study["looks"][goal]
    where = f" ({md.code(look['where'])})" if look["where"] else ""
    smallest = "smallest p" if look["where"] else "p"
    text = f"{found}; {smallest} {look['p']:.2g}{where}"
    return _by_chance(study, look["p"] < look["level"], claim, text)


def _estimate_checks(study: Study) -> list[Verdict]:
    table = study["parameters"]
    bias = max(bias_deviation(row) for row in table.values())
    errors = [row["model_error_percent"] for row in table.values()]
    return [
        _look(
            study,
            "nees",
            f"mean NEES is {len(table)}",
            f"{study['nees_mean']:.2f}, not refuted from {study['nees_lower']:.2f} to "
            f"{study['nees_upper']:.2f}",
        ),
        _look(study, "nees_distribution", "NEES is distributed as chi-square", "by all runs"),
        _look(study, "bias", "no parameter has a bias", f"largest {bias:.2f} standard errors"),
        _look(study, "bias_together", "nor have all together", "by the claimed covariance"),
        _look(
            study,
            "sigma",
            "every predicted sigma is the scatter",
            f"off by {min(errors):+.1f} to {max(errors):+.1f} %",
        ),
        *(_coverage_check(study, count) for count in (1, 2, 3)),
    ]


def _coverage_check(study: Study, count: int) -> Verdict:
    goal = f"coverage_{count}_sigma"
    shares = [row[goal] for row in study["parameters"].values()]
    return _look(
        study,
        goal,
        f"{count} sigma covers {md.percent(nominal_coverage(count))} of runs",
        f"{md.percent(min(shares))} to {md.percent(max(shares))}",
    )


def _bound_checks(study: Study) -> list[Verdict]:
    values = [row["rmse_over_bound"] for row in study["parameters"].values()]
    return [
        judged(
            f"filter's covariance is the Cramér-Rao bound to {SAME_COVARIANCE:g} sigma",
            f"{study['filter_difference']:.1g}",
            study["filter_difference"] <= SAME_COVARIANCE,
        ),
        _look(
            study,
            "rmse_over_bound",
            "RMSE is at the Cramér-Rao bound",
            f"{min(values):.3f} to {max(values):.3f} of it",
        ),
    ]


def _innovation_checks(study: Study, number: int) -> list[Verdict]:
    one = study["innovations"]["passes"][number - 1]
    whole, p = one["stretches"][0], at_innovations(Innovations(**one["looks"]))
    nis, share = whole["nis"], whole["share_beyond_band"]
    return [
        _by_chance(
            study,
            missed("nis", p["nis"]),
            f"pass {number}: mean NIS is {nis['expected_least']:.4f}",
            f"{nis['mean']:.4f}, not refuted from {nis['lower']:.4f} to {nis['upper']:.4f}; "
            f"p {p['nis']:.2g}",
        ),
        _by_chance(
            study,
            missed("white", p["white"]),
            f"pass {number}: white innovations, {md.percent(OUTSIDE_BAND)} of autocorrelations "
            "beyond their band",
            f"{share_text(share)}; p {p['white']:.2g}",
        ),
    ]


def bias_deviation(row: Mapping[str, float]) -> float:
    """Size of a bias in Monte Carlo standard errors."""
    return abs(row["bias_over_mcse"])


def sigma_deviation(row: Mapping[str, float]) -> float:
    """Error of a predicted sigma in Monte Carlo standard errors."""
    return abs(row["model_error_percent"] / row["model_error_percent_mcse"])


def outside_of(table: Study, name: str, expected: float, suffix: str = "") -> list[str]:
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
