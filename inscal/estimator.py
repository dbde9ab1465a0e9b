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
the parameters, the attitude error at the start, and augmented states that do not wander. What does
(`inscal.augmentation`) is left out of it by every pass alike, as navigation is.

A result that a further pass leaves as it is solves the normal equations of that estimate, wherever
the passes started and whatever T_0. Their derivatives are those at error-free sensors. True ones
span the same space but for products of the parameters, so the estimate differs from the exact one
by their relative size: by 0.001 sigma rms at the reference case, by 0.014 at errors ten times as
large.

**Where a first pass fails.** Its estimates wander through all that the prior allows while little
has been seen. If noise is small against the second-order errors of that, 1e-6 at the reference
case's priors, they are taken for information, and the pass may run away. A tight pass cannot: what
it neglects is of second order in the distance from x0 to the estimate, whatever the noise. So a run
whose pass ran away starts anew with tight passes about the prior's mean, and loses nothing but a
pass or two.

**When passes have converged** is the subject of `inscal.convergence`.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import solve_triangular

from inscal.augmentation import Augmented
from inscal.disturbance import NOTHING, Disturbance
from inscal.motion import Site
from inscal.parameters import COUNT
from inscal.recursion import ATTITUDE, Gains, InitialStd, compute_gains, refuse_degenerate
from inscal.schedule import Schedule
from inscal.state_model import NoiseModel, StateModel, Transitions, build_transitions

CONSTANTS = COUNT + ATTITUDE
"""Estimated constants without augmentation: 27 parameters, three components of initial attitude
error. Augmented states that do not wander follow them."""

_TIGHT = 3.0
"""Sigmas of tight covariance in units of the final ones. The translation is exact in the linear
model whatever this number; at the reference case 0.03 to 10 lead to the same estimates to 0.0014
sigma rms."""


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
        The parameters estimated; all 27 and no more if not said otherwise.
    augmented : Disturbance
        Sizes of what augmented states stand for: their priors, and how they wander.
    max_passes : int, optional
        A run that has not converged after `passes` gets up to so many, and every run is judged by
        its own data. Without it there are exactly `passes`, and estimates need only be finite.
    convergence_sigma : float
        A run has converged when a further pass changes no constant by so much of its sigma.
    innovation_limit : float
        A run whose innovations squared are more than so many times what the filter expects of
        them has failed.
    """

    noise: NoiseModel
    prior: InitialStd
    passes: int
    update_interval: float
    model: StateModel = field(default_factory=StateModel)
    augmented: Disturbance = NOTHING
    max_passes: int | None = None
    convergence_sigma: float = 0.01
    innovation_limit: float = 100.0


@dataclass(frozen=True)
class Estimator:
    """Everything a calibration uses that does not depend on the run.

    Attributes
    ----------
    first : Gains
        Gains of the first pass; their final covariance is that of the estimates.
    later : Gains or None
        Gains of all further passes, None where there is one pass only.
    passes, max_passes : int
        Passes of every run, and of a run that does not converge.
    convergence_sigma : float
        Change of the constants, in their sigmas, that ends a run's passes.
    innovation_limit : float
        Innovation ratio beyond which a run has failed.
    per_sigma, per_tight : ndarray, shape (c,)
        Of c constants, 30 without augmented ones: one over the final sigma, and over that which a
        further pass starts from, the root of T_0's diagonal; zero where not modelled.
    translate : ndarray, shape (c, c)
        The P T^-1 of the module docstring.
    pull : ndarray, shape (c, c)
        The P P_0^-1 of the module docstring.
    augmented : Augmented or None
        Augmented states.
    """

    first: Gains
    later: Gains | None
    passes: int
    max_passes: int
    convergence_sigma: float
    innovation_limit: float
    per_sigma: np.ndarray
    per_tight: np.ndarray
    translate: np.ndarray
    pull: np.ndarray
    augmented: Augmented | None = None

    @property
    def parameter_covariance(self) -> np.ndarray:
        """Predicted covariance of the 27 estimates, SI; zero where not modelled."""
        return self.first.covariance[:COUNT, :COUNT]

    @property
    def predicted_std(self) -> np.ndarray:
        """Predicted standard deviation of the 27 estimates, SI; zero where not modelled."""
        return np.sqrt(np.diag(self.parameter_covariance))

    @property
    def augmented_names(self) -> tuple[str, ...]:
        """Names of the augmented states that do not wander, as they follow the constants."""
        return self.augmented.names[: len(self.per_sigma) - CONSTANTS] if self.augmented else ()

    @property
    def augmented_std(self) -> np.ndarray:
        """Predicted standard deviation of their estimates, SI."""
        return np.sqrt(np.diag(self.first.covariance)[CONSTANTS:])

    @property
    def judged(self) -> bool:
        """Whether runs are judged by their own data, and get further passes if they need them."""
        return self.max_passes > self.passes

    def gains(self, number: int) -> Gains:
        """Gains of pass `number`, counted from 0."""
        return self.first if number == 0 or self.later is None else self.later


def build_estimator(
    schedule: Schedule, site: Site, belief: Belief, augmented: Augmented | None = None
) -> Estimator:
    """Gains of all passes for a schedule.

    Parameters
    ----------
    schedule : Schedule
    site : Site
    belief : Belief
    augmented : Augmented, optional
        Of the belief's model, where it has augmented states.

    Returns
    -------
    Estimator

    Raises
    ------
    ValueError
        If the schedule is not a whole number of update intervals long, or a turn does not fit; if
        an observation is without noise, or a predicted sigma is zero or not finite; if there are
        fewer passes at most than for every run.
    """
    transitions = build_transitions(
        schedule, site, belief.model, belief.noise, update_interval=belief.update_interval
    )
    return estimator_of(transitions, belief, augmented)


def estimator_of(
    transitions: Transitions,
    belief: Belief,
    augmented: Augmented | None = None,
    observed: np.ndarray | None = None,
) -> Estimator:
    """Gains of all passes for transitions of any origin.

    Parameters
    ----------
    transitions : Transitions
        Of the belief's model, without augmented states.
    belief : Belief
    augmented : Augmented, optional
        Of the belief's model, where it has augmented states.
    observed : ndarray, shape (updates, 6), optional
        As of `compute_gains`.

    Returns
    -------
    Estimator

    Raises
    ------
    ValueError
        As `build_estimator`, but for the schedule.
    """
    model, noise, std = belief.model, belief.noise, belief.prior
    if not min(noise.velocity, noise.position) > 0.0:
        raise ValueError(
            f"observations have a noise of {noise.velocity:g} m/s and {noise.position:g} m; "
            "an estimator needs both above zero"
        )
    max_passes = belief.passes if belief.max_passes is None else belief.max_passes
    if max_passes < belief.passes:
        raise ValueError(f"at most {max_passes} passes, but every run gets {belief.passes}")
    if (augmented.names if augmented else ()) != model.augmented:
        raise ValueError(f"augmented states {model.augmented} of the model are not prepared")
    if augmented is not None:
        transitions = replace(transitions, augmented=augmented.transitions)
    first = compute_gains(transitions, model, noise, std, observed)
    modelled = np.concatenate([model.columns, np.arange(COUNT, len(first.covariance))])
    prior = initial_constants(transitions, std)
    final = np.sqrt(np.diag(first.covariance))
    tight = np.minimum(_TIGHT * final, prior)
    translate, pull, later = np.eye(len(prior)), np.zeros((len(prior), len(prior))), None
    if max_passes > 1:
        refuse_degenerate(first, model)
        parameter, attitude, further = np.split(tight, [COUNT, CONSTANTS])
        tight_std = replace(std, parameter=parameter, attitude=attitude, augmented=further)
        later = compute_gains(transitions, model, noise, tight_std, observed)
        # in units of the final sigmas: SI covariances span twenty orders of magnitude
        block, unit = np.ix_(modelled, modelled), final[modelled]
        translate[block] = np.divide.outer(unit, unit) * _ratio(
            first.root[block] / unit[:, None], later.root[block] / unit[:, None]
        )
        pull = first.covariance / prior**2
    return Estimator(
        first=first,
        later=later,
        passes=belief.passes,
        max_passes=max_passes,
        convergence_sigma=belief.convergence_sigma,
        innovation_limit=belief.innovation_limit,
        per_sigma=_reciprocal(final),
        per_tight=_reciprocal(tight),
        translate=translate,
        pull=pull,
        augmented=augmented,
    )


def initial_constants(transitions: Transitions, std: InitialStd) -> np.ndarray:
    """Standard deviations of all constants at the start, shape (c,)."""
    about = transitions.augmented
    further = np.zeros(0) if about is None else about.constant_std
    return np.concatenate([std.parameter, std.attitude, further])


def _reciprocal(std: np.ndarray) -> np.ndarray:
    """One over standard deviations; zero where those are, of parameters not modelled."""
    return np.divide(1.0, std, where=std > 0.0, out=np.zeros_like(std))


def _ratio(wide: np.ndarray, narrow: np.ndarray) -> np.ndarray:
    """P T^-1 from the lower triangular roots of P and T.

    Never from P and T: with their roots the digits that it loses are half as many.
    """
    half = solve_triangular(narrow, wide, lower=True)
    return np.asarray(solve_triangular(narrow.T, half @ wide.T, lower=False).T)
