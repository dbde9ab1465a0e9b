"""Whether the sigmas that a filter claims are refuted by its errors, and what would have been seen.

An honest filter's errors are normal with the covariance it claims. So the mean NEES is chi-square,
and so is the mean square of each parameter's errors over its claimed sigma (`inscal.chance`). The
NEES gets half of `LEVEL`, the parameters share the other half: of an honest filter's campaigns
`LEVEL` at most are called dishonest. What is not refuted is called honest only where the runs are
enough to see an error; how large a one they see is `Sight`.

A summary is a plain dict, as read from its JSON file.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from inscal import chance
from pipeline.study.verdict import MET, NOT_MET, UNDECIDED, Verdict
from pipeline.words import markdown as md

HONEST = "honest"
"""Word for sigmas that are not refuted by runs that would have shown an error of `BLIND`."""

TOO_SMALL, TOO_LARGE = "too small", "too large"
"""Words for a claimed sigma that is refuted."""

LEVEL = 0.01
"""Largest share of campaigns in which an honest filter is called dishonest."""

POWER = 0.9
"""Share of campaigns in which an error is found that counts as seen."""

BLIND = 0.5
"""Smallest seen lack of one sigma from which on runs cannot judge: half of it."""

Summary = Mapping[str, Any]


class Sight(NamedTuple):
    """Smallest lack of claimed sigmas that is seen, as a share of what they should be.

    Attributes
    ----------
    one : float
        Of one parameter's sigma, by its RMSE.
    every : float
        Of all sigmas alike, by the mean NEES.
    """

    one: float
    every: float


def ratios(summary: Summary) -> dict[str, float]:
    """RMSE over predicted standard deviation of the parameters the filter models."""
    table = {name: row["rmse_over_predicted"] for name, row in summary["parameters"].items()}
    return {name: ratio for name, ratio in table.items() if math.isfinite(ratio)}


def most_deviant(summary: Summary) -> str:
    """Name the parameter whose RMSE is farthest from the predicted one, by factor."""
    table = ratios(summary)
    return max(table, key=lambda name: abs(math.log(table[name])))


def one_level(count: int) -> float:
    """Level of the look at each of so many parameters."""
    return LEVEL / 2.0 / count


def nees_limits(runs: int, count: int) -> tuple[float, float]:
    """Limits beyond which the mean NEES of so many parameters refutes the sigmas."""
    low, high = chance.chi_square_limits(runs * count, 1.0 - LEVEL / 2.0)
    return count * float(low), count * float(high)


def ratio_limits(runs: int, count: int) -> tuple[float, float]:
    """Limits beyond which RMSE over predicted refutes the sigma of one of so many parameters."""
    low, high = chance.chi_square_limits(runs, 1.0 - one_level(count))
    return math.sqrt(low), math.sqrt(high)


def sight(runs: int, count: int) -> Sight:
    """What so many runs of a filter of so many parameters see in `POWER` of campaigns."""
    return Sight(
        chance.smallest_seen(runs, one_level(count), POWER),
        chance.smallest_seen(runs * count, LEVEL / 2.0, POWER),
    )


def refuted(summary: Summary) -> dict[str, str]:
    """Parameters whose RMSE refutes their sigma, with the word for it, largest ratio first."""
    found = ratios(summary)
    if not found:
        return {}
    low, high = ratio_limits(summary["runs_done"], len(found))
    outside = {name: ratio for name, ratio in found.items() if not low <= ratio <= high}
    ordered = sorted(outside, key=outside.__getitem__, reverse=True)
    return {name: TOO_SMALL if outside[name] > high else TOO_LARGE for name in ordered}


def honesty(summary: Summary) -> str:
    """Verdict on the filter's covariance, by the mean NEES and by every parameter's RMSE."""
    runs, count, mean = summary["runs_done"], len(ratios(summary)), summary["nees_mean"]
    low, high = nees_limits(runs, count)
    words = set(refuted(summary).values())
    if mean > high or (mean >= low and TOO_SMALL in words):
        return "dishonest (overconfident)"
    if mean < low or words:
        return "dishonest (too cautious)"
    return HONEST if sight(runs, count).one <= BLIND else UNDECIDED


def told(summary: Summary) -> str:
    """Say whether the filter's sigma is honest, which parameters refute it, and what runs see."""
    runs = summary["runs_done"]
    seen = sight(runs, len(ratios(summary)))
    one, every = md.percent(seen.one), md.percent(seen.every)
    return (
        f"{honesty(summary)}{md.named(list(refuted(summary)))}\n"
        f"in {100 * POWER:g} % of campaigns {runs} runs find one sigma {one} too small, "
        f"or all {every}"
    )


def sigma_word(summary: Summary, name: str) -> str:
    """Verdict on the sigma of a parameter that the filter models."""
    found = refuted(summary)
    if name in found:
        return found[name]
    seen = sight(summary["runs_done"], len(ratios(summary))).one
    return HONEST if seen <= BLIND else UNDECIDED


def checks(name: str, summary: Summary) -> list[Verdict]:
    """Judge the sigmas of a campaign, all together and one by one.

    Parameters
    ----------
    name : str
        Of the campaign.
    summary : summary

    Returns
    -------
    list of Verdict
        With what the runs would have shown in `POWER` of campaigns.
    """
    found = ratios(summary)
    runs, count, mean = summary["runs_done"], len(found), summary["nees_mean"]
    seen = sight(runs, count)
    (low, high), (least, most) = nees_limits(runs, count), ratio_limits(runs, count)
    outside = refuted(summary)
    return [
        _check(
            f"{md.code(name)}: the mean NEES does not refute the sigmas {_power(seen.every)}",
            f"mean NEES {md.number(mean)}, not refuted from {low:.2f} to {high:.2f}",
            refuted=not low <= mean <= high,
            seen=seen,
        ),
        _check(
            f"{md.code(name)}: no RMSE refutes its sigma {_power(seen.one)}",
            f"RMSE/predicted {min(found.values()):.3f} to {max(found.values()):.3f}, not refuted "
            f"from {least:.3f} to {most:.3f}{md.named(list(outside))}",
            refuted=bool(outside),
            seen=seen,
        ),
    ]


def _power(too_small: float) -> str:
    return f"({100 * POWER:g} % power at {md.percent(too_small)} too small)"


def _check(claim: str, found: str, *, refuted: bool, seen: Sight) -> Verdict:
    return Verdict(claim, found, NOT_MET if refuted else MET if seen.one <= BLIND else UNDECIDED)
