"""What a calibration campaign estimates with: the gains of every pass, and how passes connect.

**Passes.** The filter is linear, the sensors are not quite: one pass leaves second-order errors of
several sigma. A further pass over the same record linearises about the last result x0: the
estimated parameters and the attitude that the fixed-point smoother found for the start. Two things
must not change with it:

- *The prior.* It stays centred where it was, or weakly observed parameters would be counted twice.
- *The linearisation.* With the prior's wide covariance the early, noisy estimates of a pass stray
  far from x0 before they return, and closed-loop feedback drags the linearisation along. A later
  pass therefore runs with a tight covariance T_0 about x0, a few times the final sigma.

The data's own information is the final information less the prior's, so the tight result x_T with
covariance T translates exactly into the one that the prior (m, P_0), final covariance P, gives:

    x = x0 + P T^-1 (x_T - x0) + P P_0^-1 (m - x0),    P^-1 = T^-1 - T_0^-1 + P_0^-1.

With it the passes are Gauss-Newton steps on the maximum a posteriori estimate (Bell, The iterated
Kalman smoother as a Gauss-Newton method, SIAM J. Optim. 4, 1994). The vector x holds the constants:
the parameters and the attitude error at the start.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from inscal.motion import Site
from inscal.parameters import COUNT
from inscal.recursion import ATTITUDE, Gains, InitialStd, compute_gains
from inscal.schedule import Schedule
from inscal.state_model import NoiseModel, StateModel, build_transitions

CONSTANTS = COUNT + ATTITUDE
"""Estimated constants: 27 parameters and three components of initial attitude error."""

_TIGHT = 3.0
"""Sigmas of tight covariance in units of the final ones. The translation is exact in the linear
model whatever this number; 1, 3 and 10 give the same errors to a hundredth of a sigma."""


@dataclass(frozen=True)
class Belief:
    """What a filter takes for true, and how it goes about a record.

    Attributes
    ----------
    noise : NoiseModel
        Noise of sensors and observations.
    prior : InitialStd
        Standard deviations of the initial errors and of the parameters.
    passes : int
        Over the record, at least 1.
    update_interval : float
        From one update to the next, s.
    model : StateModel
        The parameters estimated; all 27 if not said otherwise.
    """

    noise: NoiseModel
    prior: InitialStd
    passes: int
    update_interval: float
    model: StateModel = field(default_factory=StateModel)


@dataclass(frozen=True)
class Estimator:
    """Everything a calibration uses that does not depend on the run.

    Attributes
    ----------
    first : Gains
        Gains of the first pass; their final covariance is that of the estimates.
    later : Gains or None
        Gains of all further passes, None where there is one pass only.
    passes : int
    translate : ndarray, shape (30, 30)
        The P T^-1 of the module docstring.
    pull : ndarray, shape (30, 30)
        The P P_0^-1 of the module docstring.
    """

    first: Gains
    later: Gains | None
    passes: int
    translate: np.ndarray
    pull: np.ndarray

    @property
    def parameter_covariance(self) -> np.ndarray:
        """Predicted covariance of the 27 estimates, SI; zero where not modelled."""
        return self.first.covariance[:COUNT, :COUNT]

    @property
    def predicted_std(self) -> np.ndarray:
        """Predicted standard deviation of the 27 estimates, SI; zero where not modelled."""
        return np.sqrt(np.diag(self.parameter_covariance))

    def gains(self, number: int) -> Gains:
        """Gains of pass `number`, counted from 0."""
        return self.first if number == 0 or self.later is None else self.later


def build_estimator(schedule: Schedule, site: Site, belief: Belief) -> Estimator:
    """Gains of all passes for a schedule.

    Parameters
    ----------
    schedule : Schedule
    site : Site
    belief : Belief

    Returns
    -------
    Estimator

    Raises
    ------
    ValueError
        If the schedule is not a whole number of update intervals long, or a turn does not fit.
    """
    model, noise, std = belief.model, belief.noise, belief.prior
    transitions = build_transitions(
        schedule, site, model, noise, update_interval=belief.update_interval
    )
    first = compute_gains(transitions, model, noise, std)
    prior = np.concatenate([std.parameter, std.attitude])
    identity = np.eye(CONSTANTS)
    if belief.passes == 1:
        return Estimator(first, None, belief.passes, identity, np.zeros_like(identity))
    final = np.sqrt(np.diag(first.covariance))
    tight = np.minimum(_TIGHT * final, prior)
    tight_std = replace(std, parameter=tight[:COUNT], attitude=tight[COUNT:])
    later = compute_gains(transitions, model, noise, tight_std)
    modelled = np.concatenate([model.columns, np.arange(COUNT, CONSTANTS)])
    block = np.ix_(modelled, modelled)
    # solved in units of the final sigmas: SI covariances span twenty orders of magnitude
    scale = np.outer(final[modelled], final[modelled])
    wide, narrow = first.covariance[block] / scale, later.covariance[block] / scale
    translate = identity.copy()
    translate[block] = np.linalg.solve(narrow, wide).T * np.divide.outer(
        final[modelled], final[modelled]
    )
    return Estimator(first, later, belief.passes, translate, first.covariance / prior**2)
