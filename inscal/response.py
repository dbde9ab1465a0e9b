"""What apparent increments of a disturbed record do to navigation, step by step and by update.

An apparent increment a of a step comes at a constant rate in it and moves the navigation errors by
the integral of Phi(t_end - t) u(t), u = a / duration in the states that it enters: attitude errors,
which are those of the axes and not of the body, by -1, velocity errors by +1.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from inscal.disturbance import Disturbance
from inscal.path import Path
from inscal.state_model import NAVIGATION, navigation_dynamics, parameter_dynamics
from inscal.unit_effects import effect

_AT_ONCE = 128
"""Update intervals."""


@dataclass(frozen=True)
class Response:
    """Effect of apparent increments on the navigation states.

    Attributes
    ----------
    steps : ndarray, shape (steps, 9, 6)
        Of each step's increments in body axes, at the end of its update interval, per rad and m/s.
    update_step : ndarray of int, shape (updates + 1,)
        First step of each update interval, and the number of steps.
    """

    steps: np.ndarray
    update_step: np.ndarray

    @property
    def update(self) -> np.ndarray:
        """Update interval of each step, shape (steps,)."""
        return np.repeat(np.arange(len(self.update_step) - 1), np.diff(self.update_step))

    def by_update(self, increments: np.ndarray) -> np.ndarray:
        """Navigation errors that some increments add over each update interval.

        Parameters
        ----------
        increments : ndarray, shape (n, steps, 6)
            rad and m/s.

        Returns
        -------
        ndarray, shape (updates, 9, n)
        """
        each = self.steps @ increments.transpose(1, 2, 0)
        return np.asarray(np.add.reduceat(each, self.update_step[:-1], axis=0))


def response(path: Path, update_interval: float) -> Response:
    """Response of navigation on a path.

    Parameters
    ----------
    path : Path
    update_interval : float
        s.

    Returns
    -------
    Response
    """
    steps, dynamics = path.steps, navigation_dynamics(path.site)
    made = Response(np.empty((len(steps.duration), NAVIGATION, 6)), steps.update_step)
    left = (made.update + 1) * update_interval - path.edges[1:]
    kinds, kind = np.unique(
        np.round(np.stack([steps.duration, np.maximum(left, 0.0)], axis=1), 9),
        axis=0,
        return_inverse=True,
    )
    into = np.zeros((NAVIGATION, 6))
    into[range(6), range(6)] = [-1.0] * 3 + [1.0] * 3
    for number, (duration, rest) in enumerate(kinds):
        block = np.zeros((NAVIGATION + 6,) * 2)
        block[:NAVIGATION, :NAVIGATION], block[:NAVIGATION, NAVIGATION:] = dynamics, into
        mean = expm(block * duration)[:NAVIGATION, NAVIGATION:] / duration
        made.steps[kind.ravel() == number] = expm(dynamics * rest) @ mean
    to_ned = steps.to_body.mT / steps.duration[:, None, None]
    for axes in (slice(0, 3), slice(3, 6)):
        made.steps[:, :, axes] = made.steps[:, :, axes] @ to_ned
    return made


@dataclass(frozen=True)
class ConstantsResponse:
    """What one unit of each constant of a source does.

    Attributes
    ----------
    navigation : ndarray, shape (updates, 9, n)
        Added to the navigation errors over each update interval.
    observation : ndarray, shape (OBSERVED, n)
        Added to every observation, m/s and m.
    """

    navigation: np.ndarray
    observation: np.ndarray


def of_parameters(
    made: Response, path: Path, columns: np.ndarray, weight: np.ndarray | None = None
) -> np.ndarray:
    """Response to one unit of sensor parameters.

    Parameters
    ----------
    made : Response
    path : Path
        The same.
    columns : ndarray of int, shape (n,)
        Which of the 27.
    weight : ndarray, shape (steps,), optional
        Size of the parameters in each step; 1 without it.

    Returns
    -------
    ndarray, shape (updates, 9, n)
    """
    duration = path.steps.duration
    rate, force = (x / duration[:, None] for x in (path.motion.angle, path.motion.velocity))
    scale = duration if weight is None else duration * weight
    bounds, updates = made.update_step, len(made.update_step) - 1
    out = np.empty((updates, NAVIGATION, len(columns)))
    for begin in range(0, updates, _AT_ONCE):  # all at once is a gigabyte
        end = min(begin + _AT_ONCE, updates)
        rows = slice(bounds[begin], bounds[end])
        each = parameter_dynamics(np.eye(3), rate[rows], force[rows])[:, :6, columns]
        each[:, :3] *= -1.0  # of navigation errors; what is reported lacks what compensation adds
        moved = made.steps[rows] @ (each * scale[rows, None, None])
        out[begin:end] = np.add.reduceat(moved, bounds[begin:end] - bounds[begin], axis=0)
    return out


def together(constants: Iterable[ConstantsResponse]) -> ConstantsResponse:
    """Responses to several constants as one, in their order."""
    every = list(constants)
    return ConstantsResponse(
        np.concatenate([each.navigation for each in every], axis=2),
        np.concatenate([each.observation for each in every], axis=1),
    )


def of_constants(
    made: Response, path: Path, disturbance: Disturbance, source: str
) -> ConstantsResponse:
    """Response to the constants of a source.

    Parameters
    ----------
    made : Response
    path : Path
        The same.
    disturbance : Disturbance
        Its times are used; sizes are not.
    source : str
        Key of `inscal.disturbance.COMPONENTS`.

    Returns
    -------
    ConstantsResponse
    """
    unit = effect(path, disturbance, source)
    return ConstantsResponse(made.by_update(unit.increments), unit.observations.T)
