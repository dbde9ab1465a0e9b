r"""Augmented states: what a filter does about disturbances that it has been told of.

Every source of `inscal.disturbance` that acts through apparent increments of the planned path can
be estimated. One unit of a state c_n adds rows a_n(s) to the apparent increments of step s
(`inscal.unit_effects`), so three things follow from the same rows: navigation takes the sum of
a_n c_n off its compensated increments, exactly what the truth has added; the linear model's columns
are what they do to the navigation errors over an update interval (`inscal.response`); and the
sigma of the source is the prior.

Those that wander are first-order Gauss-Markov biases (`inscal.wander`). They are no constants: each
pass estimates their course anew, from their stationary distribution, whatever the linearisation.
So they belong to what a pass leaves out of the constants' posterior, as navigation does, and the
passes of `inscal.estimator` stay exact. Over an interval T with x' = phi x + a u and the integral
I = g x + b u + c v the mean bias is I / T, which acts as a constant one does. In turns that leaves
out how the bias moves within a second, a share T / tau of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inscal.augmented_transitions import AugmentedTransitions
from inscal.disturbance import Disturbance
from inscal.parameters import Augmentation
from inscal.path import Path
from inscal.response import Response, response
from inscal.state_model import StateModel
from inscal.unit_effects import bias, effect
from inscal.wander import discrete, terms_of


@dataclass(frozen=True)
class Augmented:
    """Augmented states on a path.

    Attributes
    ----------
    groups : sequence of Augmentation
        Those that wander are the last.
    rows : ndarray, shape (steps, 6, n)
        What one unit of each at the start of an update interval adds to the apparent increments of
        the step, rad and m/s.
    transitions : AugmentedTransitions
    """

    groups: Sequence[Augmentation]
    rows: np.ndarray
    transitions: AugmentedTransitions

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the states."""
        return tuple(name for group in self.groups for name in group.names)

    @property
    def decay(self) -> np.ndarray:
        """Factor of every state over an update interval, shape (n,); 1 of constants."""
        constants = np.ones(self.transitions.constants)
        return np.concatenate([constants, self.transitions.decay])


def augment(
    model: StateModel,
    believed: Disturbance,
    path: Path,
    update_interval: float,
    made: Response | None = None,
) -> Augmented | None:
    """Prepare the augmented states of a filter.

    Parameters
    ----------
    model : StateModel
    believed : Disturbance
        Sizes that the filter believes in: priors, and what of it wanders.
    path : Path
    update_interval : float
        s.
    made : Response, optional
        Of the path, where it is there already.

    Returns
    -------
    Augmented or None
        None where the model has none.

    Raises
    ------
    ValueError
        If a size is zero.
    """
    groups = model.augmentations
    if not groups:
        return None
    made = made or response(path, update_interval)
    rows, std, moving = [], [], []
    for name, about in groups.items():
        size = getattr(believed, about.source)
        if not size > 0.0:
            raise ValueError(f"the state group {name} needs a prior above zero")
        if about.wanders:
            (term,) = terms_of(believed, about.source)
            (coefficients,) = discrete(term, np.array([update_interval]))
            moving += [coefficients] * len(about.names)
            unit = bias(path, about.source) * (coefficients[1] / update_interval)
        else:
            unit = effect(path, believed, about.source).increments
        rows.append(unit)
        std += [size] * len(unit)
    together = np.concatenate(rows)
    phi, gain, add, share, rest = np.array(moving).reshape(-1, 5).T
    return Augmented(
        list(groups.values()),
        np.ascontiguousarray(np.moveaxis(together, 0, 2)),
        AugmentedTransitions(
            std=np.array(std),
            navigation=made.by_update(together),
            decay=phi,
            drive=add,
            driven=np.stack([share, rest], axis=1) / gain[:, None],
        ),
    )
