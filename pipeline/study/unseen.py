"""What a path does not tell apart, whatever the state model, in words."""

from dataclasses import replace

import numpy as np

from inscal.parameters import COUNT, NAMES
from inscal.recursion import ATTITUDE
from inscal.unseen import EXACT, Unseen, unseen
from pipeline.config.load import load
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.words.markdown import number

OBLIQUE = "position25_oblique"
"""Shipped schedule whose dwells are off the axes too."""
_SHOWN = 4
_ATTITUDE = ("attitude_north", "attitude_east", "attitude_down")


def combinations(setup: Setup) -> list[tuple[tuple[str, ...], Unseen]]:
    """What a filter's record leaves as unknown as its priors.

    Parameters
    ----------
    setup : Setup

    Returns
    -------
    list of (names, Unseen)
        Names of the members; augmented states are pivots where they can be.
    """
    names, own, prior = _constants(setup)
    covariance = setup.gains.covariance[np.ix_(own, own)]
    first = np.flatnonzero(own >= COUNT + ATTITUDE).tolist()
    found = unseen(covariance, prior, first)
    return [(tuple(names[member] for member in one.members), one) for one in found]


def _constants(setup: Setup) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Names of the modelled constants, their places among all, and priors."""
    from inscal.estimator import initial_constants

    every = initial_constants(setup.transitions, setup.prior)
    own = np.concatenate([setup.model.columns, np.arange(COUNT, len(every))])
    names = [*NAMES, *_ATTITUDE, *setup.augmented_names]
    return [names[place] for place in own], own, every[own]


TITLE = f"\nnot told apart: sigma left of it, here and on schedule={OBLIQUE}"
HEADINGS = ("not told apart", "here", "oblique")
"""Of `rows`."""


def rows(setup: Setup) -> list[tuple[str, str, str]]:
    """What a path does not tell apart, and what would.

    Parameters
    ----------
    setup : Setup

    Returns
    -------
    list of (names, trace, trace elsewhere)
        A row for each combination; none where all is seen. The last says what the same errors
        leave on a path with turns of 45 degrees.
    """
    config, found = setup.config, combinations(setup)
    if not found:
        return []
    elsewhere = _traces_on(OBLIQUE, config, found) if config.schedule.name != OBLIQUE else {}
    out = []
    for names, one in found:
        shown = ", ".join(names[:_SHOWN]) + (" ..." if len(names) > _SHOWN else "")
        trace = "none" if one.exact else number(one.trace)
        other = elsewhere.get(names)
        said = "" if other is None else "none" if other < EXACT else number(other)
        out.append((shown, trace, said))
    return out


def _traces_on(
    name: str, config: Config, found: list[tuple[tuple[str, ...], Unseen]]
) -> dict[tuple[str, ...], float]:
    """Trace that the same combinations leave on another path, with nothing else known."""
    other = Setup(replace(config, schedule=load([f"schedule={name}"]).schedule))
    names, own, prior = _constants(other)
    covariance = other.gains.covariance[np.ix_(own, own)] / np.outer(prior, prior)
    information = np.linalg.inv(covariance) - np.eye(len(own))
    out = {}
    for members, one in found:
        v = np.zeros(len(own))
        places = [names.index(member) for member in members]
        v[places] = one.values / prior[places]
        out[members] = float(np.sqrt(max(float(v @ information @ v), 0.0)))
    return out
