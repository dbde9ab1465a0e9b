r"""What every error of the estimates is made of: an error budget, linear and without simulation.

A filter's estimates are linear in everything that goes into its record, to first order: initial
errors, noise, and whatever disturbs the truth beyond the model (Markley and Carpenter, Journal of
the Astronautical Sciences 57, 2009: true against design covariance). With the filter's own gains K,
transition F and selection H of what is observed, errors x of the states go on by

.. math:: x_k = (I - K_k H)(F_k x_{k-1} + w_k) + K_k v_k .

The rows L of the final estimates follow this backwards, from L_N, which picks the parameters:
M_k = L_k (I - K_k H) is what a navigation error w_k does to them, L_k K_k what one of the
observation v_k does, and L_{k-1} = M_k F_k; L_0 is what an initial error does. One sweep serves all
sources. Every pass of the filter converges to the same linear map, so the gains of the first do.

White noise of covariance Q then adds the sum of M Q M^T, an initial covariance P_0 adds
L_0 P_0 L_0^T; with the gains of the filter the two are its own covariance. A constant c of a
disturbance adds E c, E being the sum of M times what it does to navigation. Biases that wander are
carried along with the sum of M times their integrals (`inscal.wander`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from inscal.disturbance import NOTHING, Disturbance
from inscal.disturbed import Disturbed, true_noise
from inscal.kernel import compiled
from inscal.parameters import COUNT
from inscal.record import OBSERVED
from inscal.recursion import ATTITUDE, Gains, InitialStd, observation_covariance
from inscal.response import ConstantsResponse, Response, of_constants, response
from inscal.state_model import (
    NAVIGATION,
    OBSERVED_STATES,
    NoiseModel,
    StateModel,
    Transitions,
    noise_covariance,
)
from inscal.wander import discrete, terms_of

BELIEVED = "believed_"
"""Begins the names of formal sources that augmented states are about."""

PRIORS = {"attitude": slice(0, 3), "velocity": slice(3, 6), "position": slice(6, 9)}
"""Initial errors of navigation, by name."""


@dataclass(frozen=True)
class Sensitivity:
    """Errors of m estimates, all 27 or some, estimate less truth, per error of what goes in.

    Attributes
    ----------
    process : ndarray, shape (updates, m, 9)
        Of the navigation states at the end of each update interval.
    observation : ndarray, shape (updates, m, OBSERVED)
        Of each observation.
    initial : ndarray, shape (m, 9 + n + a)
        Of navigation states, modelled parameters and augmented states at the start.
    wandering : ndarray, shape (updates, m, w)
        Of the augmented states that wander, at the end of each update interval.
    """

    process: np.ndarray
    observation: np.ndarray
    initial: np.ndarray
    wandering: np.ndarray


def sensitivity(
    transitions: Transitions,
    gains: Gains,
    model: StateModel,
    *,
    parameters: Sequence[int] = range(COUNT),
    updates: int | None = None,
) -> Sensitivity:
    """Sweep backwards through the updates.

    Parameters
    ----------
    transitions : Transitions
    gains : Gains
        Of the first pass.
    model : StateModel
    parameters : sequence of int
        Whose estimates; all if not said.
    updates : int, optional
        After so many; what comes later does nothing. All if not said.

    Returns
    -------
    Sensitivity
    """
    every, columns, about = len(transitions.index), model.columns, transitions.augmented
    last = every if updates is None else updates
    gain = np.ascontiguousarray(gains.gain[:last, state_rows(model)])
    # a state is what is true less what is estimated
    of_states = np.zeros((COUNT, gain.shape[1]))
    of_states[columns, NAVIGATION + np.arange(len(columns))] = -1.0
    rows = of_states[list(parameters)]
    process = np.zeros((every, len(rows), NAVIGATION))
    observation = np.zeros((every, len(rows), OBSERVED))
    wandering = np.zeros((every, len(rows), about.wandering if about else 0))
    _sweep(
        rows,
        transitions.navigation,
        transitions.parameter,
        transitions.index[:last],
        about.navigation if about else np.zeros((every, NAVIGATION, 0)),
        about.decay if about else np.zeros(0),
        gain,
        OBSERVED_STATES.start,
        process,
        observation,
        wandering,
    )
    return Sensitivity(process, observation, rows, wandering)


def state_rows(model: StateModel) -> np.ndarray:
    """Rows of gains of the navigation states, the modelled parameters, and augmented states."""
    further = NAVIGATION + COUNT + ATTITUDE + np.arange(len(model.augmented))
    return np.concatenate([np.arange(NAVIGATION), NAVIGATION + model.columns, further])


@compiled
def _sweep(
    rows, phi, parameter, index, augmented, decay, gain, first, process, observation, wandering
):
    """Fill the last three from the last update on; `rows` changes in place."""
    count, n = len(rows), parameter.shape[2]
    further, moving = NAVIGATION + n, rows.shape[1] - len(decay)
    for k in range(len(index) - 1, -1, -1):
        observation[k] = rows @ gain[k]
        for i in range(count):
            for j in range(OBSERVED):
                rows[i, first + j] -= observation[k, i, j]
            for j in range(NAVIGATION):
                process[k, i, j] = rows[i, j]
        now = process[k]
        column = parameter[index[k]]
        for i in range(count):
            for j in range(NAVIGATION):
                total = 0.0
                for m in range(NAVIGATION):
                    total += now[i, m] * phi[m, j]
                rows[i, j] = total
            for j in range(n):
                total = 0.0
                for m in range(NAVIGATION):
                    total += now[i, m] * column[m, j]
                rows[i, NAVIGATION + j] += total
            for j in range(len(decay)):
                wandering[k, i, j] = rows[i, moving + j]
                rows[i, moving + j] *= decay[j]
            for j in range(augmented.shape[2]):
                total = 0.0
                for m in range(NAVIGATION):
                    total += now[i, m] * augmented[k, m, j]
                rows[i, further + j] += total


@dataclass(frozen=True)
class Budget:
    """Covariances of m estimates by source, SI; all 27 unless made of some.

    Attributes
    ----------
    formal : mapping of str to ndarray, shape (m, m)
        Of the noise and the priors that the filter believes in: its own covariance.
    disturbances : mapping of str to ndarray, shape (m, m)
        Of what it knows nothing of. Of noise that is not as believed, and of what augmented states
        are about, what truth adds to belief, which is negative where there is less.
    effects : mapping of str to ndarray, shape (m, n)
        Of one unit of each constant, signed: estimate less truth.
    """

    formal: Mapping[str, np.ndarray]
    disturbances: Mapping[str, np.ndarray]
    effects: Mapping[str, np.ndarray]

    @cached_property
    def formal_covariance(self) -> np.ndarray:
        """What the filter claims, shape (m, m)."""
        return np.asarray(sum(self.formal.values()))

    @cached_property
    def true_covariance(self) -> np.ndarray:
        """What is so, shape (m, m)."""
        return np.asarray(sum(self.disturbances.values(), self.formal_covariance))

    @property
    def expected_nees(self) -> float:
        """Mean NEES over the modelled parameters."""
        own = np.flatnonzero(np.diag(self.formal_covariance))
        inside = np.ix_(own, own)
        return float(
            np.trace(np.linalg.solve(self.formal_covariance[inside], self.true_covariance[inside]))
        )


@dataclass(frozen=True)
class System:
    """A filter on a path, and what it knows nothing of.

    Attributes
    ----------
    transitions : Transitions
    gains : Gains
        Of the first pass.
    model : StateModel
    noise : NoiseModel
        That the filter believes in.
    prior : InitialStd
        Likewise.
    disturbed : Disturbed or None
        What is disturbed in truth.
    factors : Disturbance
        Sizes in truth, factors of the noise among them.
    believed : Disturbance
        Sizes that the filter believes in: of its augmented states, and factors that `noise` has
        already.
    """

    transitions: Transitions
    gains: Gains
    model: StateModel
    noise: NoiseModel
    prior: InitialStd
    disturbed: Disturbed | None
    factors: Disturbance
    believed: Disturbance = NOTHING

    @cached_property
    def response(self) -> Response:
        """Of navigation to apparent increments; only of what is disturbed."""
        assert self.disturbed is not None
        return response(self.disturbed.path, self.disturbed.interval)

    @cached_property
    def constants(self) -> dict[str, ConstantsResponse]:
        """Response to the constants of each source that draws some."""
        if self.disturbed is None:
            return {}
        path, about = self.disturbed.path, self.disturbed.disturbance
        return {name: of_constants(self.response, path, about, name) for name in about.constants}

    @property
    def modelled(self) -> set[str]:
        """Sources that augmented states are about."""
        return {group.source for group in self.model.augmentations.values()}


def budget(
    system: System, *, parameters: Sequence[int] = range(COUNT), updates: int | None = None
) -> Budget:
    """Error budget of a filter on a path.

    Parameters
    ----------
    system : System
    parameters : sequence of int
        Of whose estimates; all if not said.
    updates : int, optional
        Of the estimates after so many updates; all if not said.

    Returns
    -------
    Budget
    """
    found = sensitivity(
        system.transitions, system.gains, system.model, parameters=parameters, updates=updates
    )
    formal, factors = _formal(found, system) | _believed(found, system), system.factors
    disturbances = {
        f"{name}_noise_factor": (factor**2 - 1.0) * formal[f"{name}_noise"]
        for name in ("gyro", "accel", "velocity", "position")
        for key in [f"{name}_noise_factor"]
        for factor in [getattr(factors, key) / getattr(system.believed, key)]
        if factor != 1.0
    }
    effects: dict[str, np.ndarray] = {}
    if (disturbed := system.disturbed) is not None:
        about = disturbed.disturbance
        for source, unit in system.constants.items():
            effects[source] = _of_constants(found, unit)
            size = getattr(about, source)
            disturbances[source] = size**2 * effects[source] @ effects[source].T
        weights = found.process[system.response.update] @ system.response.steps
        for source in about.processes:
            disturbances[source] = _of_process(weights, disturbed, source)
        for name, axes in (("gyro", slice(0, 3)), ("accel", slice(3, 6))):
            pulse = getattr(about, f"{name}_quantisation")
            if pulse > 0.0:
                disturbances[f"{name}_quantisation"] = _of_pulses(weights[:, :, axes], pulse)
        if about.observation_correlation_time > 0.0:
            kept = np.exp(-disturbed.interval / about.observation_correlation_time)
            true = observation_covariance(true_noise(system.noise, factors))
            disturbances["observation_correlation"] = _of_correlation(found, true, kept)
    for source in sorted(system.modelled):  # what is believed in is not added, but differs from it
        assumed = formal[BELIEVED + source]
        disturbances[source] = disturbances.get(source, np.zeros_like(assumed)) - assumed
    return Budget(formal, disturbances, effects)


def _formal(found: Sensitivity, system: System) -> dict[str, np.ndarray]:
    noise, prior, out = system.noise, system.prior, {}
    for name, alone in (
        ("gyro_noise", NoiseModel(noise.gyro, 0.0, 0.0, 0.0)),
        ("accel_noise", NoiseModel(0.0, noise.accel, 0.0, 0.0)),
    ):
        share = noise_covariance(system.transitions, alone)
        out[name] = np.einsum("kim,mn,kjn->ij", found.process, share, found.process, optimize=True)
    for name, place, sigma in (
        ("velocity_noise", slice(0, 3), noise.velocity),
        ("position_noise", slice(3, 6), noise.position),
    ):
        seen = sigma * found.observation[:, :, place]
        out[name] = np.einsum("kim,kjm->ij", seen, seen, optimize=True)
    spread = np.concatenate([prior.navigation, prior.parameter[system.model.columns]])
    scaled = found.initial[:, : len(spread)] * spread
    for name, place in (PRIORS | {"parameters": slice(NAVIGATION, None)}).items():
        out[f"prior_{name}"] = scaled[:, place] @ scaled[:, place].T
    return out


def _believed(found: Sensitivity, system: System) -> dict[str, np.ndarray]:
    """Of what augmented states are believed to be, by source."""
    about, out = system.transitions.augmented, {}
    if about is None:
        return {}
    names = list(system.model.augmented)
    initial = found.initial[:, -len(names) :] * about.std
    for group in system.model.augmentations.values():
        own = slice(names.index(group.names[0]), names.index(group.names[-1]) + 1)
        out[BELIEVED + group.source] = initial[:, own] @ initial[:, own].T
        if group.wanders:
            w = slice(own.start - about.constants, own.stop - about.constants)
            within = found.process @ about.navigation[:, :, own]
            of_u = found.wandering[:, :, w] * about.drive[w] + within * about.driven[w, 0]
            for unit in (of_u, within * about.driven[w, 1]):
                out[BELIEVED + group.source] += np.einsum("kiw,kjw->ij", unit, unit, optimize=True)
    return out


def _of_constants(found: Sensitivity, unit: ConstantsResponse) -> np.ndarray:
    moved = np.einsum("kim,kmn->in", found.process, unit.navigation, optimize=True)
    return np.asarray(moved + found.observation.sum(axis=0) @ unit.observation)


def _of_process(weights: np.ndarray, disturbed: Disturbed, source: str) -> np.ndarray:
    count, duration = weights.shape[1], disturbed.path.steps.duration
    total = np.zeros((count, count))
    first = 3 if source.startswith("accel") else 0
    for term in terms_of(disturbed.disturbance, source):
        coefficients = discrete(term, duration)
        for axis in range(first, first + 3):
            rows = np.ascontiguousarray(weights[:, :, axis])
            _carry(rows, coefficients, term.initial_std**2, total)
    return total


@compiled
def _carry(rows, coefficients, variance, total):
    """Add to `total` the covariance of the sum of rows times the integrals of one wandering bias.

    With x' = phi x + a u and the integral I = g x + b u + c v of a step, and y' = y + row I, the
    covariances of x and y go on as those of any linear system.
    """
    count = rows.shape[1]
    both = np.zeros(count)  # covariance of x and y
    for s in range(len(rows)):
        phi, g, a, b, c = coefficients[s]
        own = g * g * variance + b * b + c * c
        for i in range(count):
            for j in range(count):
                cross = rows[s, i] * both[j] + rows[s, j] * both[i]
                total[i, j] += g * cross + own * rows[s, i] * rows[s, j]
        mixed = phi * g * variance + a * b
        for i in range(count):
            both[i] = phi * both[i] + mixed * rows[s, i]
        variance = phi * phi * variance + a * a


def _of_pulses(weights: np.ndarray, pulse: float) -> np.ndarray:
    """Remainders are taken to be uniform within half a pulse, and independent."""
    change = np.diff(weights, axis=0, append=np.zeros((1, *weights.shape[1:])))
    return np.asarray(pulse**2 / 12.0 * np.einsum("sim,sjm->ij", change, change, optimize=True))


def _of_correlation(found: Sensitivity, covariance: np.ndarray, kept: float) -> np.ndarray:
    """What correlation of the observations' noise adds to white noise of that covariance."""
    count = found.observation.shape[1]
    later, total = np.zeros((count, OBSERVED)), np.zeros((count, count))
    for rows in found.observation[::-1]:
        cross = rows @ covariance @ later.T
        total += cross + cross.T
        later = kept * (later + rows)
    return total
