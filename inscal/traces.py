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
        S of the module docstring for the constants of each source that the filter does not
        estimate, per unit of them, SI.
    """
    every = {name: one for name, one in system.constants.items() if name not in system.modelled}
    if not every:
        return {}
    of_parameters, of_constants = innovations(system, list(every.values()))
    base, _ = np.linalg.qr(of_parameters)
    left = of_constants - base @ (base.T @ of_constants)
    out, first = {}, 0
    for name, each in every.items():
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
        Of each modelled parameter, and augmented state that does not wander, that is off by its
        prior sigma.
    of_constants : ndarray, shape (OBSERVED * updates, constants)
        Per unit, SI.
    """
    transitions, gains, columns = system.transitions, system.gains, system.model.columns
    about = transitions.augmented
    own = NAVIGATION + len(columns)
    unit = np.concatenate([system.prior.parameter[columns], about.std if about else np.zeros(0)])
    modelled = len(columns) + (about.constants if about else 0)
    added = np.concatenate([each.navigation for each in constants], axis=2)
    offset = np.concatenate([each.observation for each in constants], axis=1)
    updates, _, count = added.shape
    gain = gains.gain[:, state_rows(system.model)]
    x = np.zeros((gain.shape[1], modelled + count))
    x[range(NAVIGATION, NAVIGATION + modelled), range(modelled)] = unit[:modelled]
    out = np.empty((updates, OBSERVED, modelled + count))
    for k, index in enumerate(transitions.index):
        moved = transitions.navigation @ x[:NAVIGATION]
        moved += transitions.parameter[index] @ x[NAVIGATION:own]
        if about is not None:
            moved += about.navigation[k] @ x[own:]
            x[len(x) - about.wandering :] *= about.decay[:, None]
        moved[:, modelled:] += added[k]
        x[:NAVIGATION] = moved
        innovation = x[OBSERVED_STATES].copy()
        innovation[:, modelled:] -= offset
        x -= gain[k] @ innovation
        out[k] = gains.whitening[k] @ innovation
    flat = out.reshape(OBSERVED * updates, -1)
    return flat[:, :modelled], flat[:, modelled:]
