"""What a record says of the parameters: Cramér-Rao bounds by square-root information.

A second route to what `inscal.recursion` predicts. It shares the linear model and no step of the
calculation: it carries information instead of covariance, knows no gain, and starts with nothing
known of the parameters, where a covariance would be infinite.

An array R stands for the information R^T R on (navigation x, parameters p). Over an interval
x' = F x + B p + G w with unit noise w, so x = F^-1 (x' - B p - G w), and (w, x', p) have the array

    [ I               0          0               ]    noise
    [ -R_x F^-1 G     R_x F^-1   R_p - R_x F^-1 B ]    what was known before
    [ 0               H / sigma  0               ]    observation

Householder reflections make it triangular and leave R^T R as it is; the rows below those of w are
the array of (x', p) with w eliminated, which for normal variables is marginalisation (Bierman,
Factorization Methods for Discrete Sequential Estimation, 1977, ch. V and VI). At the end the rows
of p alone hold what the record says of the parameters, whatever the navigation states did.

All this is about the model linearised at error-free sensors. What the record says depends on the
true parameters only by their own relative size, 1e-3 and less.
"""

from dataclasses import dataclass

import numpy as np

from inscal.parameters import COUNT
from inscal.record import OBSERVED
from inscal.recursion import InitialStd, square_root
from inscal.state_model import (
    NAVIGATION,
    OBSERVED_STATES,
    NoiseModel,
    StateModel,
    Transitions,
)

_SILENT = 1e-9  # a direction known this much worse than the best one is not known at all


@dataclass(frozen=True)
class ParameterInformation:
    """What a record says of the parameters, without any prior knowledge of them.

    Attributes
    ----------
    root : ndarray, shape (n, n)
        Upper triangular; root^T root is the information matrix of the modelled parameters, each
        in its `unit`.
    unit : ndarray, shape (n,)
        SI.
    columns : ndarray of int, shape (n,)
        Indices of the modelled parameters in a 27-vector.
    """

    root: np.ndarray
    unit: np.ndarray
    columns: np.ndarray

    def bayesian_covariance(self, prior_std: np.ndarray) -> np.ndarray:
        """Bayesian Cramér-Rao bound of parameters with a normal prior.

        The inverse of the record's information plus the prior's (Van Trees, Detection, Estimation,
        and Modulation Theory, part I, 1968, sec. 2.4).

        Parameters
        ----------
        prior_std : ndarray, shape (27,)
            Standard deviations of independent parameters of zero mean, SI.

        Returns
        -------
        ndarray, shape (27, 27)
            Covariance that no estimate can beat, SI; zero where not modelled.
        """
        prior = prior_std[self.columns]
        # in units of the prior its own information is the identity
        stacked = np.concatenate([self.root * (prior / self.unit), np.eye(len(prior))])
        inverse = prior[:, None] * np.linalg.inv(_triangular(stacked))
        covariance = np.zeros((COUNT, COUNT))
        covariance[np.ix_(self.columns, self.columns)] = inverse @ inverse.T
        return covariance

    def classical_std(self) -> np.ndarray:
        """Classical Cramér-Rao bound: nothing is known of the parameters but by the record.

        Returns
        -------
        ndarray, shape (27,)
            Standard deviation that no unbiased estimate can beat, SI; infinite where the record
            does not determine the parameter, zero where it is not modelled.
        """
        _, size, directions = np.linalg.svd(self.root)
        known = size > _SILENT * size[0]
        variance = np.square(directions[known] / size[known, None]).sum(axis=0)
        unknown = np.square(directions[~known]).sum(axis=0) > _SILENT
        std = np.zeros(COUNT)
        std[self.columns] = np.where(unknown, np.inf, self.unit * np.sqrt(variance))
        return std


def parameter_information(
    transitions: Transitions, model: StateModel, noise: NoiseModel, std: InitialStd
) -> ParameterInformation:
    """Gather the information of a whole record on the parameters.

    Parameters
    ----------
    transitions : Transitions
        Of the same state model.
    model : StateModel
    noise : NoiseModel
        Of the observations; that of the sensors is in `transitions`.
    std : InitialStd
        Distribution of the initial navigation errors. Those of the parameters only serve as units.

    Returns
    -------
    ParameterInformation
    """
    nav, unit = NAVIGATION, std.parameter[model.columns]
    states = nav + len(unit)
    backward = np.linalg.inv(transitions.navigation)
    by_noise = backward @ square_root(transitions.noise)
    by_parameter = backward @ (transitions.parameter * unit)

    array = np.zeros((nav + states + OBSERVED, nav + states))
    before, observation = array[nav : nav + states], array[nav + states :]
    array[:nav, :nav] = np.eye(nav)
    sigma = np.repeat([noise.velocity, noise.position], 3)
    observation[:, nav:][:, OBSERVED_STATES] = np.diag(1 / sigma)

    root = np.zeros((states, states))
    root[:nav, :nav] = np.diag(1 / std.navigation)
    for index in transitions.index:
        of_nav = root[:, :nav]
        before[:, :nav] = -(of_nav @ by_noise)
        before[:, nav : 2 * nav] = of_nav @ backward
        before[:, 2 * nav :] = root[:, nav:] - of_nav @ by_parameter[index]
        root = _triangular(array)[nav:, nav:]
    return ParameterInformation(root[nav:, nav:], unit, model.columns)


def _triangular(array: np.ndarray) -> np.ndarray:
    return np.asarray(np.linalg.qr(array, mode="r"))
