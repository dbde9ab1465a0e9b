"""The consistency study's numbers, made ready for the template that has the words."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from inscal.parameters import COUNT
from inscal.record import OBSERVED
from inscal.statistics import nominal_coverage
from pipeline.proof import goals
from pipeline.proof.goals import Study, outside_of, share_text
from pipeline.proof.looks import LEVEL, LOOKS, OUTSIDE_BAND, level
from pipeline.proof.power import KINDS, PERFECT
from pipeline.proof.statistics import CONFIDENCE, LAGS
from pipeline.study import verdict
from pipeline.study.honesty import BLIND, POWER
from pipeline.words import markdown as md
from pipeline.words.render import render

_TEMPLATES = Path(__file__).parent / "templates"


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
    checks, earlier = goals.checks(study), goals.earlier_checks(study)
    one_seen = goals.one_seen(study)
    return render(
        _TEMPLATES,
        "consistency.md.jinja",
        study=study,
        count=COUNT,
        goals=len(checks),
        met=[check for check in checks if check.met],
        missed=[check.claim for check in checks if check.word == verdict.NOT_MET],
        open=[check.claim for check in checks if check.word == verdict.UNDECIDED],
        earlier=earlier,
        verdicts=verdict.table([*checks, *earlier], "goal", plain=(verdict.MET,)),
        level=LEVEL,
        goals_by_chance=len(LOOKS),
        level_one=level("nees"),
        level_each=level("bias"),
        power=POWER,
        one_seen=one_seen,
        all_seen=goals.all_seen(study),
        blind=one_seen > BLIND,
        blind_from=BLIND,
        by_chance=0.05 * COUNT,
        measured=_measured(study["measured"]),
        **_estimates(study),
        **_coverage(study["parameters"]),
        **_bounds(study["parameters"]),
        **_innovations(study["innovations"]),
    )


def _measured(found: Mapping[str, Any]) -> dict[str, Any]:
    if not found:
        return {}
    return {
        "perfect": share_text(found[PERFECT]),
        "campaigns": found[PERFECT]["campaigns"],
        "rows": [
            (kind.subject, f"{100 * kind.too_small:g} %", share_text(found[name]))
            for name, kind in KINDS.items()
            if kind.too_small
        ],
    }


def _estimates(study: Study) -> dict[str, Any]:
    table = study["parameters"]
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
    look = study["looks"]["nees_distribution"]
    return {
        "estimate_rows": rows,
        "beyond_bias": _beyond(table, goals.bias_deviation),
        "beyond_sigma": _beyond(table, goals.sigma_deviation),
        "distribution_refuted": look["p"] < look["level"],
    }


def _beyond(table: Study, deviation: Callable[[Any], float]) -> list[dict[str, float]]:
    found = [deviation(row) for row in table.values()]
    return [
        {
            "limit": limit,
            "found": sum(one > limit for one in found),
            "chance": len(found) * (1.0 - nominal_coverage(limit)),
        }
        for limit in (2, 3)
    ]


def _coverage(table: Study) -> dict[str, Any]:
    rows = []
    for name, row in table.items():
        shares = (f"coverage_{count}_sigma" for count in (1, 2, 3))
        cells = (md.share(row[s], row[f"{s}_lower"], row[f"{s}_upper"]) for s in shares)
        rows.append((md.code(name), *cells))
    nominal = {count: nominal_coverage(count) for count in (1, 2, 3)}
    return {
        "coverage_rows": rows,
        "coverage_headings": (
            "parameter",
            *(f"{count} sigma, {md.percent(share)} expected" for count, share in nominal.items()),
        ),
        "coverage_outside": [
            {"sigmas": count, "names": outside_of(table, f"coverage_{count}_sigma", share)}
            for count, share in nominal.items()
        ],
    }


def _bounds(table: Study) -> dict[str, Any]:
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
    prior = max(row["classical_bound"] / row["bayesian_bound"] for row in table.values()) - 1.0
    return {
        "bound_rows": rows,
        "bound": {
            "mean": math.exp(sum(map(math.log, ratios)) / len(ratios)),
            "lowest": min(ratios),
            "highest": max(ratios),
            "outside": outside_of(table, "rmse_over_bound", 1.0),
            "prior": prior if math.isfinite(prior) else None,
        },
    }


def _innovations(about: Study) -> dict[str, Any]:
    passes = list(enumerate(about["passes"], start=1))
    rows = [
        (
            str(number),
            md.ends((s["first_position"], s["last_position"])),
            f"{s['nis']['mean']:.4f} ({s['nis']['lower']:.4f} to {s['nis']['upper']:.4f})",
            "yes" if goals.nis_consistent(s["nis"]) else "**no**",
            share_text(s["share_beyond_band"]),
            "yes" if goals.white(s["share_beyond_band"]) else "**no**",
        )
        for number, one in passes
        for s in one["stretches"]
    ]
    whole = about["passes"][0]["stretches"][0]["nis"]["mean"]
    return {
        "about": about,
        "observed": OBSERVED,
        "lags": LAGS,
        "outside_band": OUTSIDE_BAND,
        "confidence": CONFIDENCE,
        "innovation_rows": rows,
        "parts": len(rows) - len(passes),
        "passes": [_pass(number, one) for number, one in passes],
        "told": about["passes"][-1]["units_told"],
        "first": about["first_pass_nees"],
        "first_nis_off": 100.0 * abs(whole / OBSERVED - 1.0),
    }


def _pass(number: int, one: Study) -> dict[str, Any]:
    by_position = one["nis_by_position"]
    highest = max(range(len(by_position)), key=by_position.__getitem__)
    return {
        "number": number,
        "highest": by_position[highest],
        "position": highest + 1,
        "pooled": one["pooled"],
    }


def _with_error(row: Mapping[str, float], name: str, factor: float = 1.0) -> str:
    """Write a number to the second digit of its standard error, which follows in parentheses."""
    value, error = factor * row[name], factor * row[f"{name}_mcse"]
    if not error > 0.0:
        return f"{value:.3g} ({error:.2g})"
    digits = max(0, 1 - math.floor(math.log10(error)))
    return f"{value:.{digits}f} ({error:.{digits}f})"
