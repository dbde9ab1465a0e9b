"""Schedule file, page and data of what a search for a schedule has found."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from inscal.parameters import NAMES, UNITS
from inscal.schedule import attitudes
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.console.errors import ConfigError
from pipeline.study.design import Search
from pipeline.study.promise import Found, Promise
from pipeline.words import markdown as md
from pipeline.words.render import render

PAPER = "position25"
"""Schedule that a designed one is held against."""
_LETTERS = ("NS", "EW", "DU")
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
        disturbance=config.disturbance.name if found.considered else None,
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
    turns = [f"{angle:g} about {axis.lower()}" for angle, axis, _ in found.path.rotations]
    postures = _postures(search, found.path)
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
            (str(k + 1), posture, f"{time:g}", turn, _points(earned))
            for k, (posture, time, turn, earned) in enumerate(
                zip(postures, durations, [*turns, ""], found.earned, strict=True)
            )
        ],
        left_out=found.left_out,
        considered=found.considered,
        disturbance=config.disturbance.name,
        disturbed=found.path.disturbed,
        paper_disturbed=paper.disturbed if paper else None,
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


def _postures(search: Search, path: Promise) -> list[str]:
    """Where the body axes point in every position, such as "N E D"; "NE" is halfway."""
    setup = Setup(replace(search.config, schedule=search.schedule_of(path)))
    return [
        " ".join(
            "".join(_LETTERS[row][int(axis[row] < 0.0)] for row in range(3) if abs(axis[row]) > 0.1)
            for axis in attitude.T
        )
        for attitude in attitudes(setup.schedule)
    ]


def _points(value: float) -> str:
    return "" if np.isnan(value) else f"{100 * value:.3f}"


def content(config: Config, found: Found) -> dict[str, Any]:
    """What was found, as it is written."""
    return {
        "name": config.design.name,
        "objective": config.design.objective,
        "joint_share": found.path.share,
        "joint_share_disturbed": found.path.disturbed,
        "limit": found.limit,
        "left_out": found.left_out,
        "considered": found.considered,
        "total_time_s": found.path.total,
        "durations_s": found.path.durations,
        "rotations": _rotations(found.path),
        "parameter": list(NAMES),
        "sigma_over_bound": found.path.sigma_over_bound.tolist(),
        "steps": found.steps,
        "course": found.course,
    }
