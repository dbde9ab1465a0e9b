"""Schedule file, page and data of what a search for a schedule has found."""

from pathlib import Path
from typing import Any

import numpy as np

from inscal import units
from inscal.parameters import NAMES, UNITS
from pipeline.config.schema import Config
from pipeline.console.errors import ConfigError
from pipeline.study.design import Found, Promise, Search
from pipeline.words import markdown as md
from pipeline.words.render import render

PAPER = "position25"
"""Schedule that a designed one is held against."""
_TEMPLATES = Path(__file__).parent / "templates"


def schedule_text(config: Config, found: Found) -> str:
    """Text of the schedule's file, with a comment of what it promises."""
    return render(
        _TEMPLATES,
        "designed.yaml.jinja",
        called=config.design.name,
        objective=config.design.objective,
        share=found.path.share,
        noise=config.noise.name,
        total=found.path.total,
        usual=found.path.durations[-1],
        schedule=config.schedule,
        posture=list(config.schedule.initial_posture),
        rotations=_rotations(found.path),
        seed=config.design.seed,
        start_from=config.design.start_from,
        steps=found.steps,
    )


def _rotations(path: Promise) -> list[str]:
    return [f"[{angle:g}, {axis}, {duration:g}]" for angle, axis, duration in path.rotations]


def page(config: Config, search: Search, found: Found) -> str:
    """Write the page of what was found.

    Parameters
    ----------
    config : Config
    search : Search
    found : Found

    Returns
    -------
    str
    """
    paper = _paper(search)
    durations = found.path.durations
    angles = ["", *(f"{t.angle / units.DEGREE:g} about {'xyz'[t.axis]}" for t in found.path.turns)]
    return render(
        _TEMPLATES,
        "design.md.jinja",
        called=config.design.name,
        objective=config.design.objective,
        noise=config.noise.name,
        total=found.path.total,
        positions=len(durations),
        share=found.path.share,
        limit=found.limit,
        steps=found.steps,
        chains=config.design.chains,
        seed=config.design.seed,
        paper=PAPER,
        paper_share=paper.share if paper else None,
        paper_total=paper.total if paper else None,
        places=[
            (str(k + 1), f"{time:g}", turn, _points(earned))
            for k, (time, turn, earned) in enumerate(
                zip(durations, [*angles[1:], ""], found.earned, strict=True)
            )
        ],
        left_out=found.left_out,
        sigmas=[
            (md.code(name), UNITS[i], f"{found.path.sigma_over_bound[i]:.3f}",
             f"{paper.sigma_over_bound[i]:.3f}" if paper else "")
            for i, name in enumerate(NAMES)
        ],
        course=[(f"{100 * part:.0f} %", f"{100 * share:.3f} %") for part, share in found.course],
    )  # fmt: skip


def _paper(search: Search) -> Promise | None:
    """The paper's path as the search judges it, if it knows its turns."""
    try:
        return search.exactly(*search.known(PAPER))
    except ConfigError:
        return None


def _points(value: float) -> str:
    return "" if np.isnan(value) else f"{100 * value:.3f}"


def content(config: Config, found: Found) -> dict[str, Any]:
    """What was found, as it is written."""
    return {
        "name": config.design.name,
        "objective": config.design.objective,
        "joint_share": found.path.share,
        "limit": found.limit,
        "left_out": found.left_out,
        "total_time_s": found.path.total,
        "durations_s": found.path.durations,
        "rotations": _rotations(found.path),
        "parameter": list(NAMES),
        "sigma_over_bound": found.path.sigma_over_bound.tolist(),
        "steps": found.steps,
        "course": found.course,
    }
