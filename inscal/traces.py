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

from inscal.budget import System
from inscal.record import OBSERVED
from inscal.response import ConstantsResponse
from inscal.state_model import NAVIGATION, OBSERVED_STATES


def traces(system: System) -> dict[str, np.ndarray]:
    """Squares and products of the traces of constants.

    Parameters
    ----------
    system : System

    Returns
    -------
    dict of str to ndarray, shape (n, n)
        S of the module docstring for the constants of each source, per unit of them, SI.
    """
    every = list(system.constants.values())
    if not every:
        return {}
    of_parameters, of_constants = innovations(system, every)
    base, _ = np.linalg.qr(of_parameters)
    left = of_constants - base @ (base.T @ of_constants)
    out, first = {}, 0
    for name, each in system.constants.items():
        own = left[:, first : first + each.observation.shape[1]]
        out[name] = own.T @ own
        first += own.shape[1]
    return out


def innovations(
    system: System, constants: list[ConstantsResponse]
) -> tuple[np.ndarray, np.ndarray]:
    """Innovations that errors leave behind, in units of their own covariance.

    Parameters
    ----------
    system : System
    constants : list of ConstantsResponse

    Returns
    -------
    of_parameters : ndarray, shape (OBSERVED * updates, parameters)
        Of each modelled parameter that is off by its prior sigma.
    of_constants : ndarray, shape (OBSERVED * updates, constants)
        Per unit, SI.
    """
    transitions, gains, columns = system.transitions, system.gains, system.model.columns
    modelled = len(columns)
    added = np.concatenate([each.navigation for each in constants], axis=2)
    offset = np.concatenate([each.observation for each in constants], axis=1)
    updates, _, count = added.shape
    states = np.concatenate([np.arange(NAVIGATION), NAVIGATION + columns])
    gain = gains.gain[:, states]
    x = np.zeros((len(states), modelled + count))
    x[NAVIGATION:, :modelled] = np.diag(system.prior.parameter[columns])
    out = np.empty((updates, OBSERVED, modelled + count))
    for k, index in enumerate(transitions.index):
        moved = transitions.navigation @ x[:NAVIGATION]
        moved += transitions.parameter[index] @ x[NAVIGATION:]
        moved[:, modelled:] += added[k]
        x[:NAVIGATION] = moved
        innovation = x[OBSERVED_STATES].copy()
        innovation[:, modelled:] -= offset
        x -= gain[k] @ innovation
        out[k] = gains.whitening[k] @ innovation
    flat = out.reshape(OBSERVED * updates, -1)
    return flat[:, :modelled], flat[:, modelled:]
