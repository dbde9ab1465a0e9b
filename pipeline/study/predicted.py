"""What the filter's covariance promises for all bounds at once, and what would be enough."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from inscal.box import share_within
from inscal.parameters import COUNT, NAMES
from pipeline.config.setup import Setup
from pipeline.words.render import sentence

_TEMPLATES = Path(__file__).parent / "templates"
_FACTORS = (1e-3, 1e3)  # of noise, that are tried


@dataclass(frozen=True)
class Predicted:
    """Shares of runs, where truth is what the filter believes.

    Attributes
    ----------
    share : float
        Of runs that keep all bounds at once, from the full covariance of the modelled parameters.
    asked : float
        What is asked of it.
    worst : str
        Parameter with the largest sigma over its bound.
    worst_ratio : float
        That ratio.
    noise_factor : float
        By which all noise, of sensors and observations, may be multiplied for the share to be what
        is asked; NaN if no factor makes it so.
    time_factor : float
        The same of the time, by the rule that sigma falls with its square root.
    """

    share: float
    asked: float
    worst: str
    worst_ratio: float
    noise_factor: float
    time_factor: float


def predicted(setup: Setup) -> Predicted:
    """Predict from the covariance of the filter's last update.

    Parameters
    ----------
    setup : Setup

    Returns
    -------
    Predicted
    """
    covariance = setup.gains.covariance[:COUNT, :COUNT] / np.outer(setup.unit, setup.unit)
    modelled = np.diag(covariance) > 0.0
    covariance, bound = covariance[np.ix_(modelled, modelled)], setup.bound[modelled]
    ratio = np.where(modelled, setup.gains.parameter_std[-1] / setup.unit / setup.bound, 0.0)
    asked, worst = setup.config.bounds.joint_share, int(np.argmax(ratio))

    def excess(log_factor: float) -> float:
        return share_within(covariance * np.exp(2.0 * log_factor), bound) - asked

    low, high = np.log(_FACTORS)
    factor = np.nan
    if excess(low) > 0.0 > excess(high):
        factor = float(np.exp(brentq(excess, low, high, xtol=1e-4)))
    return Predicted(
        share_within(covariance, bound),
        asked,
        NAMES[worst],
        float(ratio[worst]),
        factor,
        factor**-2.0,
    )


def line(found: Predicted) -> str:
    """Say it in a sentence or two."""
    return sentence(_TEMPLATES, "predicted", **vars(found))
