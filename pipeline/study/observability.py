"""What a path makes observable: ranks, how sigmas fall, weak combinations."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from inscal import observability as obs
from inscal.parameters import NAMES
from inscal.recursion import observation_covariance
from pipeline.config.schema import Config
from pipeline.config.setup import Setup

CONVENTIONS: dict[str, obs.Convention] = {
    "dwells alone": obs.Convention(),
    "dwells, the Earth's rate on the lever arms": obs.Convention(lever="earth"),
    "turns on the gyros": obs.Convention(gyro="turning"),
    "turns on gyros and lever arms": obs.Convention(gyro="turning", lever="turning"),
}
"""Plain ways to let a turn enter the constant dynamics of a position."""

TIED = 0.9
"""Absolute correlation from which on two parameters are called tied."""

WEAK_SHARE = 0.1
"""Share of the initial sigma that a combination must keep to be called weakly observed."""

_DIRECTIONS = 3


@dataclass(frozen=True)
class Observability:
    """How well a path lets a filter know its parameters.

    Attributes
    ----------
    share : ndarray, shape (positions, 27)
        Sigma at the end of each position over the initial one; 0 where not modelled.
    final_std : ndarray, shape (27,)
        Final sigma in paper units.
    directions : list of Direction
        Weakest combinations, weakest first.
    tied : list of (int, int, float)
        Pairs of correlation `TIED` or more.
    """

    share: np.ndarray
    final_std: np.ndarray
    directions: list[obs.Direction]
    tied: list[tuple[int, int, float]]


def rank_counts(config: Config, convention: obs.Convention) -> tuple[obs.Ranks, obs.Ranks]:
    """Count ranks after every position of a path: in SI by default tolerance, and unit-free.

    Parameters
    ----------
    config : Config
    convention : Convention

    Returns
    -------
    tuple of Ranks
    """
    setup = Setup(config)
    dynamics = obs.system_matrices(setup.schedule, setup.site, convention)
    noise = np.sqrt(np.diag(observation_covariance(setup.noise)))
    sigma = np.concatenate([setup.prior.navigation, setup.prior.parameter])
    return obs.ranks(dynamics), obs.unit_free_ranks(
        dynamics, sigma, noise, float(setup.schedule.durations.mean())
    )


def observability_of(setup: Setup) -> Observability:
    """Run the covariance recursion over a path and see what it leaves unknown.

    Parameters
    ----------
    setup : Setup

    Returns
    -------
    Observability
    """
    gains, prior = setup.gains, setup.prior.parameter
    covariance = gains.covariance[: len(NAMES), : len(NAMES)]
    return Observability(
        share=obs.sigma_share(
            gains.parameter_std, prior, setup.schedule, setup.config.estimator.update_interval_s
        ),
        final_std=gains.parameter_std[-1] / setup.unit,
        directions=obs.weakest_directions(covariance, prior, _DIRECTIONS),
        tied=obs.tied_pairs(covariance, TIED),
    )


def direction_text(direction: obs.Direction) -> str:
    """Name a combination and what is known of it."""
    (first, weight), *others = direction.weights
    text = f"{NAMES[first]} ({weight:.2f})"
    for index, weight in others:
        text += f" {'with' if weight > 0 else 'against'} {NAMES[index]} ({weight:.2f})"
    known = "weakly observed" if direction.share > WEAK_SHARE else "observed"
    return f"{text}: {100 * direction.share:.2g} % of its initial sigma is left, {known}"


def tied_text(pair: tuple[int, int, float]) -> str:
    """Name two parameters whose errors go together."""
    first, second, correlation = pair
    return f"{NAMES[first]} and {NAMES[second]}: correlation {correlation:.3f}"


def share_table(found: Observability) -> str:
    """CSV text: one row per parameter, one column per position."""
    frame = pd.DataFrame(
        found.share.T,
        index=pd.Index(NAMES, name="parameter"),
        columns=[f"position_{n}" for n in range(1, len(found.share) + 1)],
    )
    return frame.to_csv(float_format="%.6g")
