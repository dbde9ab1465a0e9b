"""The page on what leaving out quadratic terms and lever arms costs."""

from collections.abc import Mapping

import numpy as np
import xarray as xr

from inscal.parameters import NAMES
from pipeline.charts import style
from pipeline.config.schema import Config
from pipeline.paper import claims
from pipeline.paper.ablation import FULL, MODELS, Ablation, Reduced
from pipeline.study import findings
from pipeline.study.verdict import MET, NOT_MET, Verdict
from pipeline.words import markdown as md

_OMITTED = {
    "states33_quadratic": "the lever arms",
    "states33_lever_arm": "the quadratic terms",
    "states30": "both",
}
_SHOWN = 4  # parameters named where the cost is spoken of


def ablation_text(config: Config, ablations: Mapping[str, Ablation]) -> str:
    """Compose the page.

    Parameters
    ----------
    config : Config
    ablations : mapping of str to Ablation
        By truth.

    Returns
    -------
    str
        Markdown.
    """
    first = next(iter(ablations.values())).full
    sections = [
        f"# {judge(ablations).title}",
        "The paper adds six states, three quadratic terms of the accelerometers and three inner "
        "lever arms, to a classic filter of 30, and claims that calibration becomes more accurate. "
        "Here the same simulated records, with all 27 sensor errors in them, go through filters of "
        f"36, 33 and 30 states: {len(config.schedule.rotations) + 1} positions, noise "
        f"{style.noise_text(first.attrs['noise'])}. Runs are paired, so the ratios are of the same "
        "calibrations. A parameter that a filter does not model is estimated as zero: its error is "
        "minus its true value.",
        judge(ablations).table,
        "![RMSE of each filter over that of 36 states](ablation.png)",
        "Lines are intervals that hold for all parameters of a filter at once; significant is what "
        "they leave no doubt of. Where a single nearly diverged run makes up much of a mean square "
        "error the RMSE is hardly known, and medians decide.",
        _reading(ablations),
    ]
    for truth, ablation in ablations.items():
        sections += _truth_section(truth, ablation)
    sections.append("Every number is in `ablation.csv`.")
    return "\n\n".join(sections) + "\n"


def _reading(ablations: Mapping[str, Ablation]) -> str:
    """Say how the cost of the quadratic terms hangs on their unit."""
    lines = []
    for truth, ablation in ablations.items():
        full, own = ablation.full, ablation.reduced["states33_lever_arm"]
        missed = own.modelled & (own.summary["share_within_bound"].to_numpy() < findings.ENOUGH)
        kept = missed & (full["share_within_bound"].to_numpy() < findings.ENOUGH)
        unit = style.unit_text("accel_quadratic", full.attrs["quadratic_unit"])
        lines.append(
            f"{truth}, {unit}: without quadratic terms {int(missed.sum())} of "
            f"{int(own.modelled.sum())} bounds are missed, {int(kept.sum())} of them with "
            f"{FULL}; the largest ratio is {_times(own.cost.ratio[own.modelled].max())}"
        )
    return "\n\n".join(
        (
            "What the quadratic terms are worth hangs on the unit in which their size is read:",
            md.bullets(lines),
        )
    )


def judge(ablations: Mapping[str, Ablation]) -> claims.Page:
    """Verdicts on what each filter of fewer states costs, by truth."""
    found = [
        verdict(f"with {truth}: leaving out {omitted} costs accuracy", ablation.reduced[end])
        for truth, ablation in ablations.items()
        for end, omitted in _OMITTED.items()
    ]
    title = "What it costs to leave out quadratic terms and lever arms"
    return claims.page_of(title, found, ("claim", "ours", "verdict"), bold=(NOT_MET,))


def verdict(claim: str, reduced: Reduced) -> Verdict:
    """Judge a claim that a filter of fewer states is worse."""
    worse, better = int(reduced.worse.sum()), int(reduced.better.sum())
    found = (
        f"of the {int(reduced.modelled.sum())} parameters it models {worse} significantly worse, "
        f"{better} better; {_largest_text(reduced)}"
    )
    balance = f"{MET} on balance, not throughout" if worse > better else NOT_MET
    return Verdict(claim, found, MET if worse > 0 and better == 0 else balance)


def _largest_text(reduced: Reduced) -> str:
    ratio = np.where(reduced.modelled, reduced.cost.ratio, 0.0)
    kind = "the median error" if reduced.one_run_decides else "RMSE"
    named = md.listed(
        f"{md.code(NAMES[i])} {_times(ratio[i])}" for i in np.argsort(-ratio)[:_SHOWN]
    )
    return f"{kind} grows most for {named}"


def _times(ratio: float) -> str:
    return f"{ratio:.0f}×" if ratio >= 100 else f"{ratio:.3g}×"


def _truth_section(truth: str, ablation: Ablation) -> list[str]:
    rows = [_filter_row(FULL, ablation.full)]
    rows += [_filter_row(MODELS[end], ablation.reduced[end].summary) for end in _OMITTED]
    headings = (
        *("filter", "runs done", "failed", "modelled", "mean NEES", "if honest"),
        "bounds missed among the modelled",
    )
    tails = [
        f"{MODELS[end]}: one run makes up {100 * reduced.heaviest:.0f} % of a mean square error, "
        "so this filter is judged by medians"
        for end, reduced in ablation.reduced.items()
        if reduced.one_run_decides
    ]
    unit = ablation.full.attrs["quadratic_unit"]
    parts = [
        f"## With {truth}",
        f"Quadratic terms in units of {style.unit_text('accel_quadratic', unit)}.",
        md.table(headings, rows, 1),
        f"A bound counts as missed where fewer than {100 * findings.ENOUGH:g} % of runs keep it; "
        "NEES is over the parameters that the filter models.",
        "RMSE ratio to the 36-state filter (95 %, for all parameters at once); in brackets where "
        "the filter does not model the parameter:",
        _ratio_table(ablation, _rmse_cell),
    ]
    if tails:
        parts += [
            md.bullets(tails),
            "Ratio of median |error|, likewise:",
            _ratio_table(ablation, _median_cell),
        ]
    return [*parts, "Bias, with its Monte Carlo standard error:", _bias_table(ablation)]


def _filter_row(name: str, summary: xr.Dataset) -> tuple[str, ...]:
    modelled = summary["predicted_std"].to_numpy() > 0.0
    missed = summary["share_within_bound"].to_numpy() < findings.ENOUGH
    return (
        name,
        str(int(summary.runs_done)),
        str(int(summary.runs_failed)),
        str(int(modelled.sum())),
        f"{float(summary.nees_mean):.4g}",
        f"{float(summary.nees_lower):.1f} to {float(summary.nees_upper):.1f}",
        str(int((missed & modelled).sum())),
    )


def _ratio_table(ablation: Ablation, cell) -> str:
    full = ablation.full
    rows = [
        (
            md.code(name),
            str(full["unit"].values[index]),
            f"{full['rmse'].values[index]:.3g} "
            f"({full['rmse_lower'].values[index]:.3g} to {full['rmse_upper'].values[index]:.3g})",
            *(cell(ablation.reduced[end], index) for end in _OMITTED),
        )
        for index, name in enumerate(NAMES)
    ]
    headings = ("parameter", "unit", f"RMSE, {FULL} (95 %)", *(MODELS[end] for end in _OMITTED))
    return md.table(headings, rows, 2)


def _rmse_cell(reduced: Reduced, index: int) -> str:
    found = reduced.comparison
    keys = ("ratio", "simultaneous_lower", "simultaneous_upper")
    return _cell(reduced, index, *(float(found[key].values[index]) for key in keys))


def _median_cell(reduced: Reduced, index: int) -> str:
    found = reduced.median
    values = found.ratio[index], found.lower[index], found.upper[index]
    return _cell(reduced, index, *map(float, values))


def _cell(reduced: Reduced, index: int, ratio: float, low: float, high: float) -> str:
    # an interval over more than three powers of ten says only that the ratio is not known
    interval = f"{low:.3g} to {high:.3g}" if high < 1e3 * low else "not known"
    text = f"{ratio:.3g} ({interval})"
    return text if reduced.modelled[index] else f"[{text}]"


def _bias_table(ablation: Ablation) -> str:
    summaries = [ablation.full, *(ablation.reduced[end].summary for end in _OMITTED)]
    rows = [
        (
            md.code(name),
            str(ablation.full["unit"].values[index]),
            *(
                f"{s['bias'].values[index]:.2g} ± {s['bias_mcse'].values[index]:.1g}"
                for s in summaries
            ),
        )
        for index, name in enumerate(NAMES)
    ]
    headings = ("parameter", "unit", FULL, *(MODELS[end] for end in _OMITTED))
    return md.table(headings, rows, 2)
