"""Text, numbers and figure of the comparison with the paper's Table 3."""

import numpy as np
from matplotlib.figure import Figure

from inscal.parameters import KIND_OF, KINDS, NAMES, UNITS
from pipeline.charts import style
from pipeline.config.setup import Setup
from pipeline.console.output import json_text
from pipeline.paper import claims
from pipeline.paper.accuracy_study import Checked, Study, kind_probability
from pipeline.paper.noise import LEVEL, SCALES, SIGMAS
from pipeline.study import verdict as verdicts
from pipeline.study.verdict import Verdict
from pipeline.words import markdown as md

_RARE = 0.01  # probability on either side from which on a kind's errors are called atypical
_ALIKE, _CORRELATED = (0.5, 2.0), 0.5  # sizes and correlation of errors of one cause
_PAPER_COLOR = style.NOISE_COLORS["noisy"]


def claims_of(study: Study) -> claims.Page:
    """Give the verdicts as the claims of the page."""
    return claims.page_of("The simulated calibration of the paper (Table 3)", judge(study))


def text(study: Study) -> str:
    """Compose the report in Markdown."""
    sections = (
        f"# {claims_of(study).title}",
        _setup(study),
        "## Is it reproduced?",
        claims_of(study).table,
        "## Truth and estimates",
        _table(study),
        "![Errors of both against the bounds](accuracy.png)",
        _sizes(study),
        "## The noise that would explain the paper's errors",
        _explained(study),
        "## How much noise each bound can bear",
        _margins(study),
    )
    return "\n\n".join(sections) + "\n"


def judge(study: Study) -> list[Verdict]:
    """Verdicts on the bounds and on the size of the errors."""
    table, share = study.summary, study.summary["share_within_bound"].to_numpy()
    worst = int(np.argmin(share))
    lower = float(table["share_within_bound_lower"][worst])
    upper = float(table["share_within_bound_upper"][worst])
    held = int((share >= LEVEL).sum())
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
            f"each bound is kept in {100 * LEVEL:g} % of runs",
            *(lower, upper, LEVEL),
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


def _setup(study: Study) -> str:
    config = study.config
    schedule = style.schedule_text({"schedule": vars(config.schedule)})
    return (
        f"{schedule}, {style.passes_text(config.estimator.passes)}, "
        f"{study.runs} runs with the paper's truth; {config.noise.name} noise "
        f"({style.noise_text(vars(config.noise))}). The paper states no noise: this is a choice. "
        f"One 1e-9 of quadratic term is {Setup(config).quadratic_unit:.4g} s²/m here "
        f"(`sensor.quadratic_unit={config.sensor.quadratic_unit}`)."
    )


def _table(study: Study) -> str:
    headings = (
        *("parameter", "unit", "truth", "paper's estimate", "our run 0"),
        *("our mean", "RMSE", "99.7 % of errors below", "bound", "paper's error over bound"),
    )
    summary = study.summary
    rows = []
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
    return md.table(headings, rows, 2)


def _sizes(study: Study) -> str:
    bias, error = study.one_pass_bias, study.paper_error
    correlation = float(np.corrcoef(bias / study.bound, error / study.bound)[0, 1])
    size = _rms(bias / study.bound) / _rms(error / study.bound)
    alike = _ALIKE[0] <= size <= _ALIKE[1] and correlation >= _CORRELATED
    return (
        "A single pass leaves second-order errors that are the same in every run with this truth. "
        f"They are {'perhaps' if alike else 'not'} what the paper's errors are: in units of the "
        f"bounds, the mean error of one pass is {size:.2f} times the paper's in size, and its "
        f"correlation with the paper's errors over the {len(NAMES)} parameters is "
        f"{correlation:.2f}."
    )


def _explained(study: Study) -> str:
    found, noise = study.explanation, study.config.noise
    probability = kind_probability(study.paper_error, found.sigma)
    odd = [kind for kind, p in probability.items() if not _RARE < p < 1.0 - _RARE]
    ratio = study.matched_rmse / found.sigma
    small = [kind for kind in odd if probability[kind] <= _RARE]
    lines = (
        f"The paper's {len(NAMES)} errors are most likely with the gyros' noise times "
        f"{found.gyro:.1f} (95 % region {found.gyro_range[0]:.1f} to {found.gyro_range[1]:.1f}), "
        f"that is {found.gyro * noise.gyro_angle_random_walk_deg_per_sqrt_h:.2g} °/√h, and the "
        f"noise of accelerometers and observations times {found.other:.1f} "
        f"({found.other_range[0]:.1f} to {found.other_range[1]:.1f}), that is "
        f"{found.other * noise.accel_white_noise_ug_per_sqrt_hz:.2g} µg/√Hz, "
        f"{found.other * noise.velocity_observation_m_per_s:.2g} m/s and "
        f"{found.other * noise.position_observation_m:.2g} m.",
        f"There the sum of squared errors over predicted sigma is {found.chi_square:.1f}, "
        f"{len(NAMES)} being typical.",
        f"A campaign at that noise ({study.config.campaign.runs} runs, {study.matched_failed} "
        f"failed) has RMSE over predicted sigma between {ratio.min():.2f} and {ratio.max():.2f}.",
        f"Kinds whose errors are atypical there (probability below {100 * _RARE:g} % on one side): "
        + (md.listed(f"`{k}` (too {'small' if k in small else 'large'})" for k in odd) or "none")
        + ".",
    )
    rows = [
        (
            md.code(kind),
            f"{_rms(study.paper_error[members]):.3g}",
            f"{_rms(study.summary['rmse'].to_numpy()[members]):.3g}",
            f"{_rms(found.sigma[members]):.3g}",
            f"{_rms(study.matched_rmse[members]):.3g}",
            KINDS[kind].unit,
            f"{100 * probability[kind]:.2f} %",
        )
        for kind in KINDS
        for members in [np.array(KIND_OF) == kind]
    ]
    headings = (
        *("kind", "paper's errors, rms", "our RMSE", "sigma at that noise"),
        *("RMSE at that noise", "unit", "probability of errors as small as the paper's"),
    )
    return f"{md.bullets(lines)}\n\n{md.table(headings, rows, 1)}"


def _margins(study: Study) -> str:
    noise = study.config.noise
    units = (noise.gyro_angle_random_walk_deg_per_sqrt_h, noise.accel_white_noise_ug_per_sqrt_hz)
    rows = [
        (
            md.code(kind),
            f"{md.sizes(study.bound[np.array(KIND_OF) == kind].tolist())} {KINDS[kind].unit}",
            *(
                cell
                for factor, unit in zip((margin.gyro, margin.accel), units, strict=True)
                for cell in margin_cells(factor, unit)
            ),
        )
        for kind, margin in study.margins.items()
    ]
    headings = (
        *("kind", "bound", "gyro noise, °/√h", "times configured"),
        *("accel. noise, µg/√Hz", "times configured"),
    )
    intro = (
        f"The largest noise at which each bound holds in {100 * LEVEL:g} % of runs: predicted "
        f"sigma of the worst parameter of the kind, times {SIGMAS:.3f}, equals the bound. One "
        "sensor's noise is varied, the rest stays as configured. `none`: the bound fails at any "
        "level of this noise, because the rest alone is too much."
    )
    return "\n\n".join(
        (intro, md.table(headings, rows, 2), md.bullets(map(_checked_text, study.checked)))
    )


def margin_cells(factor: float, unit: float) -> tuple[str, str]:
    """Write a margin: the noise itself and its ratio to the configured noise."""
    if factor == 0.0:
        return "none", "none"
    if not np.isfinite(factor):
        return f"above {unit * SCALES[-1]:.2g}", f"above {SCALES[-1]:g}"
    return f"{unit * factor:.2g}", f"{factor:.2f}"


def _checked_text(checked: Checked) -> str:
    lower, upper = checked.interval
    agrees = "agrees with" if lower <= LEVEL <= upper else "contradicts"
    return (
        f"Verified for the tightest bound under {checked.sensor} noise: a campaign at the limit of "
        f"`{checked.kind}` keeps it, for `{checked.parameter}`, in {checked.within} of "
        f"{checked.runs} runs ({100 * lower:.1f} to {100 * upper:.1f} %), which {agrees} the "
        f"predicted {100 * LEVEL:g} %."
    )


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
    return json_text(content)


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
