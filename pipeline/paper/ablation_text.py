"""The page on what leaving out quadratic terms and lever arms costs."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import xarray as xr

from inscal.parameters import NAMES
from pipeline.charts import style
from pipeline.config.schema import Config
from pipeline.paper import claims
from pipeline.paper.ablation import FULL, MODELS, Ablation, Reduced
from pipeline.paper.claims import TEMPLATES
from pipeline.study import findings
from pipeline.study.verdict import MET, NOT_MET, Verdict
from pipeline.words import markdown as md
from pipeline.words.render import render

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
    return render(
        TEMPLATES,
        "ablation.md.jinja",
        claims=judge(ablations),
        count=len(NAMES),
        positions=len(config.schedule.rotations) + 1,
        noise=style.noise_text(first.attrs["noise"]),
        full=FULL,
        models=[MODELS[end] for end in _OMITTED],
        enough=findings.ENOUGH,
        truths=[_truth(name, ablation) for name, ablation in ablations.items()],
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


def _truth(name: str, ablation: Ablation) -> dict[str, Any]:
    """Give what the page says of one kind of truth."""
    full, own = ablation.full, ablation.reduced["states33_lever_arm"]
    missed = own.modelled & (own.summary["share_within_bound"].to_numpy() < findings.ENOUGH)
    kept = missed & (full["share_within_bound"].to_numpy() < findings.ENOUGH)
    filters = [_filter_row(FULL, full)]
    filters += [_filter_row(MODELS[end], ablation.reduced[end].summary) for end in _OMITTED]
    return {
        "name": name,
        "unit": style.unit_text("accel_quadratic", full.attrs["quadratic_unit"]),
        "missed": int(missed.sum()),
        "modelled": int(own.modelled.sum()),
        "kept": int(kept.sum()),
        "largest": _times(own.cost.ratio[own.modelled].max()),
        "filters": filters,
        "rmse": _ratio_rows(ablation, _rmse_cell),
        "tails": [
            (MODELS[end], reduced.heaviest)
            for end, reduced in ablation.reduced.items()
            if reduced.one_run_decides
        ],
        "medians": _ratio_rows(ablation, _median_cell),
        "biases": _bias_rows(ablation),
    }


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


def _ratio_rows(ablation: Ablation, cell: Callable[[Reduced, int], str]) -> list[tuple[str, ...]]:
    full = ablation.full
    return [
        (
            md.code(name),
            str(full["unit"].values[index]),
            f"{full['rmse'].values[index]:.3g} "
            f"({full['rmse_lower'].values[index]:.3g} to {full['rmse_upper'].values[index]:.3g})",
            *(cell(ablation.reduced[end], index) for end in _OMITTED),
        )
        for index, name in enumerate(NAMES)
    ]


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


def _bias_rows(ablation: Ablation) -> list[tuple[str, ...]]:
    summaries = [ablation.full, *(ablation.reduced[end].summary for end in _OMITTED)]
    return [
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
