"""Text, numbers and figure of the comparison with the paper's Table 3."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from inscal.parameters import KINDS, NAMES, UNITS, members
from pipeline.charts import style
from pipeline.config.setup import Setup
from pipeline.console.output import json_text, signed
from pipeline.paper import claims
from pipeline.paper.accuracy_study import Study, kind_probability
from pipeline.paper.claims import TEMPLATES
from pipeline.paper.noise import SCALES, SIGMAS
from pipeline.study import verdict as verdicts
from pipeline.study.findings import ENOUGH
from pipeline.study.verdict import Verdict
from pipeline.words import markdown as md
from pipeline.words.render import render

_RARE = 0.01  # probability on either side from which on a kind's errors are called atypical
_ALIKE, _CORRELATED = (0.5, 2.0), 0.5  # sizes and correlation of errors of one cause
_PAPER_COLOR = style.NOISE_COLORS["noisy"]


def claims_of(study: Study) -> claims.Page:
    """Give the verdicts as the claims of the page."""
    return claims.page_of("The simulated calibration of the paper (Table 3)", judge(study))


def text(study: Study) -> str:
    """Compose the report in Markdown."""
    values = _setup(study) | _explained(study)
    return render(
        TEMPLATES,
        "accuracy.md.jinja",
        claims=claims_of(study),
        estimates=_estimates(study),
        one_pass=_one_pass(study),
        margins=_margins(study),
        checked_limits=study.checked,
        **values,
    )


def judge(study: Study) -> list[Verdict]:
    """Verdicts on the bounds and on the size of the errors."""
    table, share = study.summary, study.summary["share_within_bound"].to_numpy()
    worst = int(np.argmin(share))
    lower = float(table["share_within_bound_lower"][worst])
    upper = float(table["share_within_bound_upper"][worst])
    held = int((share >= ENOUGH).sum())
    paper = float(np.abs(study.paper_error / study.bound).max())
    paper_name = NAMES[int(np.argmax(np.abs(study.paper_error / study.bound)))]
    own = float(np.abs((study.one_run - study.truth) / study.bound).max())
    size = _rms(study.paper_error / study.summary["rmse"].to_numpy())
    return [
        verdicts.within(
            "the paper's estimates keep its own bounds",
            *(paper, 1.0),
            f"largest error over bound {paper:.2f} (`{paper_name}`)",
        ),
        verdicts.within("our run 0 keeps them", own, 1.0, f"largest error over bound {own:.2f}"),
        verdicts.share(
            f"each bound is kept in {100 * ENOUGH:g} % of runs",
            *(lower, upper, ENOUGH),
            f"{held} of {len(share)} parameters; fewest `{NAMES[worst]}`: "
            f"{md.share(share[worst], lower, upper)}",
        ),
        verdicts.near(
            "the paper's errors are of the size of ours",
            *(size, 1.0, 0.5),
            f"rms of the paper's error over our RMSE {size:.1f}",
        ),
    ]


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _setup(study: Study) -> dict[str, Any]:
    config = study.config
    return {
        "schedule": style.schedule_text({"schedule": vars(config.schedule)}),
        "passes": style.passes_text(config.estimator.passes),
        "runs": study.runs,
        "noise": config.noise,
        "noise_text": f"{config.noise.name} noise ({style.noise_text(vars(config.noise))})",
        "quadratic_si": Setup(config).quadratic_unit,
        "quadratic_unit": config.sensor.quadratic_unit,
        "count": len(NAMES),
        "level": ENOUGH,
        "sigmas": SIGMAS,
    }


def _estimates(study: Study) -> list[tuple[str, ...]]:
    summary = study.summary
    rows: list[tuple[str, ...]] = []
    for i in style.ORDER:
        rows.append(
            (
                md.code(NAMES[i]),
                UNITS[i],
                f"{study.truth[i]:g}",
                f"{study.paper[i]:g}",
                f"{study.one_run[i]:.6g}",
                f"{study.truth[i] + float(summary['bias'][i]):.6g}",
                f"{float(summary['rmse'][i]):.3g}",
                f"{float(summary['abs_error_p997'][i]):.3g}",
                f"{study.bound[i]:g}",
                f"{abs(study.paper_error[i]) / study.bound[i]:.2f}",
            )
        )
    return rows


def _one_pass(study: Study) -> dict[str, Any]:
    """Compare the errors that one pass leaves with the paper's, in units of the bounds."""
    bias, error = study.one_pass_bias / study.bound, study.paper_error / study.bound
    correlation = float(np.corrcoef(bias, error)[0, 1])
    size = _rms(bias) / _rms(error)
    alike = _ALIKE[0] <= size <= _ALIKE[1] and correlation >= _CORRELATED
    return {"size": size, "correlation": correlation, "alike": alike}


def _explained(study: Study) -> dict[str, Any]:
    found = study.explanation
    probability = kind_probability(study.paper_error, found.sigma)
    ratio = study.matched_rmse / found.sigma
    sizes = study.paper_error, study.summary["rmse"].to_numpy(), found.sigma, study.matched_rmse
    rows = [
        (
            md.code(kind),
            *(f"{_rms(size[members(kind)]):.3g}" for size in sizes),
            KINDS[kind].unit,
            f"{100 * probability[kind]:.2f} %",
        )
        for kind in KINDS
    ]
    return {
        "found": found,
        "matched": {
            "runs": study.config.campaign.runs,
            "failed": study.matched_failed,
            "lowest": ratio.min(),
            "highest": ratio.max(),
        },
        "rare": _RARE,
        "atypical": [
            (kind, "small" if p <= _RARE else "large")
            for kind, p in probability.items()
            if not _RARE < p < 1.0 - _RARE
        ],
        "kinds": rows,
    }


def _margins(study: Study) -> list[tuple[str, ...]]:
    noise = study.config.noise
    units = (noise.gyro_angle_random_walk_deg_per_sqrt_h, noise.accel_white_noise_ug_per_sqrt_hz)
    return [
        (
            md.code(kind),
            f"{md.sizes(study.bound[members(kind)].tolist())} {KINDS[kind].unit}",
            *(
                cell
                for factor, unit in zip((margin.gyro, margin.accel), units, strict=True)
                for cell in margin_cells(factor, unit)
            ),
        )
        for kind, margin in study.margins.items()
    ]


def margin_cells(factor: float, unit: float) -> tuple[str, str]:
    """Write a margin: the noise itself and its ratio to the configured noise."""
    if factor == 0.0:
        return "none", "none"
    if not np.isfinite(factor):
        return f"above {unit * SCALES[-1]:.2g}", f"above {SCALES[-1]:g}"
    return f"{unit * factor:.2g}", f"{factor:.2f}"


def numbers(study: Study) -> str:
    """JSON text of the study's numbers."""
    found, summary = study.explanation, study.summary
    content = {
        "noise_factor_gyro": found.gyro,
        "noise_factor_gyro_95": found.gyro_range,
        "noise_factor_other": found.other,
        "noise_factor_other_95": found.other_range,
        "chi_square": found.chi_square,
        "kind_probability": kind_probability(study.paper_error, found.sigma),
        "margins": {kind: vars(margin) for kind, margin in study.margins.items()},
        "checked": [vars(checked) for checked in study.checked],
        "parameters": {
            name: {
                "unit": UNITS[i],
                "truth": study.truth[i],
                "paper_estimate": study.paper[i],
                "one_run": study.one_run[i],
                "mean": study.truth[i] + float(summary["bias"][i]),
                "rmse": float(summary["rmse"][i]),
                "abs_error_p997": float(summary["abs_error_p997"][i]),
                "one_pass_bias": study.one_pass_bias[i],
                "matched_sigma": found.sigma[i],
                "matched_rmse": study.matched_rmse[i],
            }
            for i, name in enumerate(NAMES)
        },
    }
    return json_text(signed(content))


@style.styled
def figure(study: Study) -> Figure:
    """|error| over bound of every parameter: the paper's run, our campaign, the matched noise."""
    out = Figure(figsize=(10, 10))
    axes = out.subplots()
    axes.set_xscale("log")
    style.draw_rows(axes)
    order, rows = list(style.ORDER), style.row_positions()
    own = (study.summary["abs_error_p997"].to_numpy() / study.bound)[order]
    typical = (study.summary["rmse"].to_numpy() / study.bound)[order]
    matched = (study.matched_rmse / study.bound)[order]
    paper = np.abs(study.paper_error / study.bound)[order]
    axes.hlines(rows, typical, own, color=style.NOISE_COLORS["reference"], linewidth=1.5)
    axes.plot(typical, rows, "o", color=style.NOISE_COLORS["reference"], label="our RMSE")
    axes.plot(
        own,
        rows,
        "|",
        color=style.NOISE_COLORS["reference"],
        markersize=9,
        label="99.7 % of our runs are below",
    )
    axes.plot(
        matched,
        rows,
        "s",
        color=style.PREDICTION_COLOR,
        markerfacecolor="none",
        label="our RMSE at the noise that explains the paper's errors",
    )
    # an estimate printed exactly as the truth has no place on a logarithmic axis
    axes.plot(paper, rows, "D", color=_PAPER_COLOR, label="the paper's one run")
    axes.axvline(1.0, color=style.LIMIT_COLOR, linewidth=1.2)
    axes.xaxis.set_major_formatter(style.plain_numbers())
    axes.set_xlabel("|error| / bound, dimensionless (log scale); right of 1 the bound is missed")
    out.suptitle(
        "The paper's Table 3 and a campaign with the same truth\n"
        f"{study.runs} runs, {study.config.noise.name} noise: "
        f"{style.noise_text(vars(study.config.noise))}"
    )
    out.legend(loc="outside lower center", ncols=2)
    return out
