r"""What of a disturbance a record shows: the trace that it leaves in the filter's innovations.

A constant c of a disturbance moves the innovations by U c, in units of their own covariance, and
the modelled parameters, were they off by x, would move them by A x. The error of the parameters
that fits best takes its part out of U c; what is left, by least squares, is all of c that any test
of this record can see, with nothing known of the parameters beforehand:

.. math:: S = U^T (I - A A^+) U , \qquad d^2 = c^T S c .

d is in sigmas: the best test of a known direction of c finds it at d standard deviations. What such
a constant does to the estimates is E c (`inscal.budget`), in sigmas h^2 = c^T E^T P^-1 E c. Where d
is nothing beside h the constant *is* an error of the estimated parameters: no filter on this path,
and no judge of its innovations, tells them apart.
"""

import numpy as np

from inscal.budget import System, state_rows
from inscal.estimator import CONSTANTS, initial_constants
from inscal.parameters import COUNT
from inscal.record import OBSERVED
from inscal.recursion import ATTITUDE, Gains
from inscal.response import ConstantsResponse, together
from inscal.state_model import NAVIGATION, OBSERVED_STATES, StateModel, Transitions


def traces(system: System) -> dict[str, np.ndarray]:
    """Squares and products of the traces of constants.

    Parameters
    ----------
    system : System

    Returns
    -------
    dict of str to ndarray, shape (n, n)
        S of the module docstring for the constants of each source that the filter does not
        estimate, per unit of them, SI.
    """
    every = {name: one for name, one in system.constants.items() if name not in system.modelled}
    if not every:
        return {}
    of_states, of_constants = innovations(
        system.transitions, system.gains, system.model, std_of(system), together(every.values())
    )
    base, _ = np.linalg.qr(np.delete(of_states, attitude_columns(system.model), axis=1))
    left = of_constants - base @ (base.T @ of_constants)
    out, first = {}, 0
    for name, each in every.items():
        own = left[:, first : first + each.observation.shape[1]]
        out[name] = own.T @ own
        first += own.shape[1]
    return out


def innovations(
    transitions: Transitions,
    gains: Gains,
    model: StateModel,
    std: np.ndarray,
    constants: ConstantsResponse,
) -> tuple[np.ndarray, np.ndarray]:
    """Innovations that errors leave behind, in units of their own covariance.

    Parameters
    ----------
    transitions : Transitions
    gains : Gains
        Of a pass.
    model : StateModel
        Of both.
    std : ndarray, shape (c,)
        Sizes of the filter's constants, in the order of `inscal.estimator`, SI.
    constants : ConstantsResponse

    Returns
    -------
    of_states : ndarray, shape (OBSERVED * updates, n)
        Of each constant that the filter estimates, in that order, off by its size: modelled
        parameters, attitude at the start, augmented states that do not wander.
    of_constants : ndarray, shape (OBSERVED * updates, constants)
        Per unit, SI.
    """
    about, own = transitions.augmented, NAVIGATION + len(model.columns)
    size = std[estimated(model, len(std))]
    rows = [*range(NAVIGATION, own), *range(ATTITUDE), *range(own, own + len(std) - CONSTANTS)]
    added, offset = constants.navigation, constants.observation
    gain = gains.gain[:, state_rows(model)]
    x = np.zeros((gain.shape[1], len(rows) + added.shape[2]))
    x[rows, range(len(rows))] = size
    out = np.empty((len(added), OBSERVED, x.shape[1]))
    for k, index in enumerate(transitions.index):
        moved = transitions.navigation @ x[:NAVIGATION]
        moved += transitions.parameter[index] @ x[NAVIGATION:own]
        if about is not None:
            moved += about.navigation[k] @ x[own:]
            x[len(x) - about.wandering :] *= about.decay[:, None]
        moved[:, len(rows) :] += added[k]
        x[:NAVIGATION] = moved
        innovation = x[OBSERVED_STATES].copy()
        innovation[:, len(rows) :] -= offset
        x -= gain[k] @ innovation
        out[k] = gains.whitening[k] @ innovation
    flat = out.reshape(len(out) * OBSERVED, -1)
    return flat[:, : len(rows)], flat[:, len(rows) :]


def estimated(model: StateModel, constants: int) -> np.ndarray:
    """Places of the constants that a filter estimates, of so many in the order of its estimator."""
    return np.concatenate([model.columns, np.arange(COUNT, constants)])


def attitude_columns(model: StateModel) -> slice:
    """Place of the attitude at the start among those."""
    return slice(len(model.columns), len(model.columns) + ATTITUDE)


def std_of(system: System) -> np.ndarray:
    """Prior standard deviations of a system's constants, SI, in the order of its estimator."""
    return initial_constants(system.transitions, system.prior)
