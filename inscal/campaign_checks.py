"""Whether a campaign agrees with what its own filter claims: the gate's checks of one campaign.

Each check is a statistic and the interval it lies in unless something is wrong, exact for normal
errors of the claimed covariance. Where there is a statistic for every parameter, the level is that
of all together.

A filter may leave parameters out. Its covariance is zero there, and nothing is asked of them.
"""

from dataclasses import dataclass

import numpy as np
from scipy import special

from inscal.parameters import COUNT, GROUPS, KINDS, NAMES, members
from inscal.statistics import nees_interval

CHECK_LEVEL = 5e-5
"""False alarms of each kind of check."""

_RARE = 1e-4
# A violation of a bound is not believed to be rarer, whatever the normal distribution says of 30
# sigma: the tail is known from 64 000 runs.

LOOKS: dict[str, np.ndarray] = (
    {name: np.array([i]) for i, name in enumerate(NAMES)}
    | {group: np.array([NAMES.index(name) for name in names]) for group, names in GROUPS.items()}
    | {kind: members(kind) for kind in KINDS}
    | {"all": np.arange(COUNT)}
)
"""Parameters, and pools of them, that are compared: indices in a 27-vector."""


@dataclass(frozen=True)
class Sample:
    """A campaign as the gate sees it, SI.

    Attributes
    ----------
    error : ndarray, shape (runs, 27)
        NaN where a run failed.
    covariance : ndarray, shape (27, 27)
        What the filter claims; zero where it does not model the parameter.
    nees : ndarray, shape (runs,)
    sketch : ndarray, shape (runs,)
        Of the data of each run, in units of noise: equal data give equal sketches, different ones
        sketches as different as they are.
    """

    error: np.ndarray
    covariance: np.ndarray
    nees: np.ndarray
    sketch: np.ndarray

    @property
    def columns(self) -> np.ndarray:
        """Indices of the modelled parameters."""
        return modelled(self.covariance)


@dataclass(frozen=True)
class Check:
    """A statistic of one campaign and where it should lie.

    Attributes
    ----------
    name : str
    value, lower, upper : float
    """

    name: str
    value: float
    lower: float
    upper: float

    @property
    def passed(self) -> bool:
        """Whether the value is in the interval."""
        return self.lower <= self.value <= self.upper


def modelled(covariance: np.ndarray) -> np.ndarray:
    """Indices of the parameters that a covariance, shape (27, 27), speaks of."""
    return np.flatnonzero(np.diag(covariance) > 0.0)


def consistency(sample: Sample, share: float = 1.0) -> list[Check]:
    """Checks of a campaign against its own covariance: NEES, mean error, independence, sigmas.

    Parameters
    ----------
    sample : Sample
    share : float
        Of `CHECK_LEVEL`, to be spent on this campaign.

    Returns
    -------
    list of Check
        The mean NEES; the generalised variance of the errors over the claimed one; runs * mean
        error^T P^-1 mean error, chi-square if the error has no mean; the largest cosine between the
        whitened errors of two runs, of which all pairs are looked at; and of each modelled
        parameter the RMSE over the claimed sigma.
    """
    level, own = CHECK_LEVEL * share, sample.columns
    runs, count = len(sample.error), len(own)
    low, high = nees_interval(runs, count, 1 - level)
    factor = np.linalg.cholesky(sample.covariance[np.ix_(own, own)])
    whitened = np.linalg.solve(factor, sample.error[:, own].T).T
    mean = whitened.mean(axis=0)
    unit = whitened / np.linalg.norm(whitened, axis=1, keepdims=True)
    # not as a matrix product: its threads cost more than it has to do
    cosine = np.abs(np.triu(np.einsum("ri,si->rs", unit, unit), 1)).max()
    pairs = runs * (runs - 1) / 2
    # the squared cosine of random directions in n dimensions is beta distributed
    limit = np.sqrt(1 - special.betaincinv((count - 1) / 2, 0.5, level / pairs))
    return [
        Check("mean NEES", float(sample.nees.mean()), low, high),
        _generalised_variance(whitened, level),
        Check("mean error", float(runs * mean @ mean), 0.0, special.chdtri(count, level)),
        Check("likeness of two runs", float(cosine), 0.0, float(limit)),
        *_honest_sigmas(sample, level),
    ]


def _generalised_variance(whitened: np.ndarray, level: float) -> Check:
    """Logarithm of the determinant of the mean square of whitened errors.

    The mean NEES is right whatever the claimed correlations are; this is not. It is a sum of
    independent logarithms of chi-square (Wilks, 1932, Biometrika 24:471-494), close to normal.
    """
    runs, count = whitened.shape
    value = np.linalg.slogdet(whitened.T @ whitened / runs)[1]
    half = 0.5 * (runs - np.arange(count))
    mean = (special.digamma(half) - np.log(runs / 2)).sum()
    width = special.ndtri(1 - level / 2) * np.sqrt(special.polygamma(1, half).sum())
    name = "log of generalised variance over the claimed one"
    return Check(name, float(value), float(mean - width), float(mean + width))


def _honest_sigmas(sample: Sample, level: float) -> list[Check]:
    """RMSE over claimed sigma, whose square times the runs is chi-square, of each parameter."""
    own, runs = sample.columns, len(sample.error)
    sigma = np.sqrt(np.diag(sample.covariance)[own])
    ratio = np.sqrt(np.mean((sample.error[:, own] / sigma) ** 2, axis=0))
    tail = level / (2 * len(own))
    low = float(np.sqrt(2 * special.gammaincinv(runs / 2, tail) / runs))
    high = float(np.sqrt(2 * special.gammainccinv(runs / 2, tail) / runs))
    return [
        Check(f"RMSE over claimed sigma of {NAMES[i]}", float(value), low, high)
        for i, value in zip(own, ratio, strict=True)
    ]


def bounds(
    error: np.ndarray, covariance: np.ndarray, bound: np.ndarray, share: float = 1.0
) -> list[Check]:
    """Runs outside each bound, and how many the baseline's sigma would let be.

    Parameters
    ----------
    error : ndarray, shape (runs, 27)
    covariance : ndarray, shape (27, 27)
        The baseline's.
    bound : ndarray, shape (27,)
        In the unit of the errors.
    share : float
        Of `CHECK_LEVEL`, to be spent on this campaign.

    Returns
    -------
    list of Check
        One per modelled parameter, the level over all of them.
    """
    own = modelled(covariance)
    sigma = np.sqrt(np.diag(covariance)[own])
    rare = np.maximum(2 * special.ndtr(-bound[own] / sigma), _RARE)
    most = np.ceil(special.bdtrik(1 - CHECK_LEVEL * share / len(own), len(error), rare))
    outside = (np.abs(error) > bound).sum(axis=0)[own]
    return [
        Check(f"runs outside the bound of {NAMES[i]}", float(count), 0.0, float(limit))
        for i, count, limit in zip(own, outside, most, strict=True)
    ]
