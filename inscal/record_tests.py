r"""Whether one record is what its filter takes it for, with nothing known of the truth.

Let r be the innovations of a pass, each update's over the Cholesky factor of its predicted
covariance, and A what the filter's constants, were they off, would add to them (`inscal.traces`).
With Q an orthonormal basis of A no value of any constant shows in (I - Q Q^T) r, so it does not
matter that a later pass starts from what was fitted to the same record: of a filter that is right
this is normal with mean zero and the covariance I - Q Q^T.

**Positions.** Its squared length over the updates of one position has the mean of a chi-square
of n - tr(Q_j Q_j^T) degrees of freedom (Q_j: the rows of Q there), and is held against one.

**Suspects.** Constants c of a suspect (`inscal.suspects`) add U c to r. With V an orthonormal
basis of (I - Q Q^T) U the score

.. math:: q = |V^T r|^2

is chi-square of as many degrees as V has columns, and with the suspect there it is noncentral by
\|V^T U c\|^2 (Rao's test: Lehmann and Romano, Testing Statistical Hypotheses, sec. 12.4.3).

**Two calibrations** of one unit differ by d, with covariance C, the sum of theirs where neither
has the other's data or a tight prior: d^T C^-1 d is chi-square. A suspect that came between them
moved it by E c (E: what c does to the estimates). With c normal, of the suspect's size s and the
covariance V at size one, d has the covariance C + s^2 E V E^T; how much likelier that makes d, at
the likeliest s, says how much it looks like the suspect.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special
from scipy.optimize import brentq, minimize_scalar

from inscal.estimator import Belief, Estimator, initial_constants
from inscal.innovations import autocorrelation
from inscal.record import OBSERVED
from inscal.response import ConstantsResponse, together
from inscal.state_model import Transitions
from inscal.traces import estimated, innovations

_HIDDEN = 1e-3
"""Share of its effect on the innovations below which what is left of a constant is no trace."""


@dataclass(frozen=True)
class Trace:
    """What of a suspect a record shows.

    Attributes
    ----------
    basis : ndarray, shape (OBSERVED * updates, dof)
        V of the module docstring.
    size : ndarray, shape (dof, n)
        V^T U: what a unit of each constant adds to it.
    moved : ndarray, shape (c, n)
        E: change of the filter's constants, per unit of each, SI.
    """

    basis: np.ndarray
    size: np.ndarray
    moved: np.ndarray

    @property
    def dof(self) -> int:
        """Degrees of freedom of the score."""
        return self.basis.shape[1]


@dataclass(frozen=True)
class Traces:
    """What a record shows, of the filter's constants and of all suspects.

    Attributes
    ----------
    base : ndarray, shape (OBSERVED * updates, n)
        Q of the module docstring.
    suspects : dict of str to Trace
    """

    base: np.ndarray
    suspects: dict[str, Trace]


def traces_of(
    estimator: Estimator,
    number: int,
    transitions: Transitions,
    belief: Belief,
    suspected: Iterable[tuple[str, ConstantsResponse]],
) -> Traces:
    """Prepare the tests of a pass.

    Parameters
    ----------
    estimator : Estimator
    number : int
        Of the pass, from 0.
    transitions : Transitions
        Of the estimator, augmented states included.
    belief : Belief
        Likewise.
    suspected : iterable of (str, ConstantsResponse)

    Returns
    -------
    Traces
    """
    count: dict[str, int] = {}

    def counted() -> Iterator[ConstantsResponse]:
        for name, each in suspected:
            count[name] = each.navigation.shape[2]
            yield each

    constants = together(counted())
    std, translate = initial_constants(transitions, belief.prior), np.eye(len(estimator.pull))
    if number > 0:
        std = np.divide(1.0, estimator.per_tight, where=estimator.per_tight > 0.0, out=0.0 * std)
        translate = estimator.translate
    of_states, of_constants = innovations(
        transitions, estimator.gains(number), belief.model, std, constants
    )
    base, _ = np.linalg.qr(of_states)
    own = estimated(belief.model, len(std))
    whole = np.linalg.norm(of_constants, axis=0)
    moved = translate[:, own] @ (std[own, None] * (of_states.T @ of_constants))
    of_constants -= base @ (base.T @ of_constants)
    out, first = {}, 0
    del constants  # a hundred megabytes of a long record
    for name, columns_of_it in count.items():
        columns = slice(first, first + columns_of_it)
        out[name] = _trace(of_constants[:, columns], whole[columns], moved[:, columns])
        first = columns.stop
    return Traces(base, out)


def _trace(left: np.ndarray, whole: np.ndarray, moved: np.ndarray) -> Trace:
    """Trace of a suspect of what is left of its constants, and the size of what there was."""
    scale = np.maximum(whole, np.finfo(float).tiny)
    basis, size, _ = np.linalg.svd(left / scale, full_matrices=False)
    basis = basis[:, size > _HIDDEN]
    seen = basis.T @ left
    seen[:, np.linalg.norm(seen, axis=0) < _HIDDEN * scale] = 0.0
    return Trace(basis, seen, moved)


def scores(traces: Traces, unit: np.ndarray) -> dict[str, np.ndarray]:
    """Chi-square of each suspect.

    Parameters
    ----------
    traces : Traces
    unit : ndarray, shape (updates, OBSERVED, lanes)
        Innovations of the pass, whitened (`inscal.innovations.whiten`).

    Returns
    -------
    dict of str to ndarray, shape (lanes,)
        Zero where a suspect has no trace.
    """
    flat = unit.reshape(-1, unit.shape[2])
    return {
        name: np.square(one.basis.T @ flat).sum(axis=0) for name, one in traces.suspects.items()
    }


def positions(
    traces: Traces, unit: np.ndarray, seen: np.ndarray, stretches: Sequence[slice]
) -> tuple[np.ndarray, np.ndarray]:
    """Chi-square of each stretch of a record, constants taken out.

    Parameters
    ----------
    traces : Traces
    unit : ndarray, shape (updates, OBSERVED, lanes)
    seen : ndarray of bool, shape (updates, OBSERVED)
        What is observed.
    stretches : sequence of slice
        Of update numbers.

    Returns
    -------
    total : ndarray, shape (stretches, lanes)
    dof : ndarray, shape (stretches,)
    """
    base, flat = traces.base, unit.reshape(-1, unit.shape[2])
    squared = np.square(flat - base @ (base.T @ flat))
    free = seen.ravel() - np.square(base).sum(axis=1)
    rows = [slice(OBSERVED * one.start, OBSERVED * one.stop) for one in stretches]
    return np.array([squared[r].sum(axis=0) for r in rows]), np.array([free[r].sum() for r in rows])


def whiteness(unit: np.ndarray, seen: np.ndarray, lags: int) -> np.ndarray:
    """Chi-square of the autocorrelations of each of the unit sequences of a record.

    Parameters
    ----------
    unit : ndarray, shape (updates, OBSERVED)
    seen : ndarray of bool, shape (updates, OBSERVED)
        What is observed; the rest is passed over.
    lags : int
        How many, far fewer than there are updates; as many degrees of freedom.

    Returns
    -------
    ndarray, shape (n,)
        Of the sequences that are long enough. Ljung and Box, On a measure of lack of fit in time
        series models, Biometrika 65, 1978.
    """
    out = []
    for column, is_seen in zip(unit.T, seen.T, strict=True):
        sequence, every = column[is_seen], np.arange(1, lags + 1)
        if len(sequence) > 10 * lags:
            squared = np.square(autocorrelation(sequence[:, None], range(1, lags + 1))[:, 0])
            count = len(sequence)
            out.append(count * (count + 2.0) * np.sum(squared / (count - every)))
    return np.array(out)


def difference_covariance(
    first: np.ndarray, second: np.ndarray, prior: np.ndarray | None
) -> np.ndarray:
    """Covariance of the difference of two estimates of the same constants from different data.

    Parameters
    ----------
    first, second : ndarray, shape (n, n)
        Covariances of the estimates.
    prior : ndarray, shape (n,), or None
        Standard deviations of the one prior of both. It pulls both the same way, by
        P_i P_0^-1 x, which leaves P_1 + P_2 - P_1 P_0^-1 P_2 - P_2 P_0^-1 P_1. None: another.

    Returns
    -------
    ndarray, shape (n, n)
    """
    both = first + second
    if prior is None:
        return both
    inverse = np.divide(1.0, np.square(prior), where=prior > 0.0, out=np.zeros_like(prior))
    common = (first * inverse) @ second
    return np.asarray(both - common - common.T)


def smallest(trace: Trace, level: float, power: float) -> np.ndarray:
    """Size of each constant of a suspect, alone, that its score finds often enough.

    Parameters
    ----------
    trace : Trace
    level : float
        False alarms.
    power : float
        Share of records in which it is to be found.

    Returns
    -------
    ndarray, shape (n,)
        SI; infinite where a constant has no trace.
    """
    if trace.dof == 0:
        return np.full(trace.size.shape[1], np.inf)
    critical = 2.0 * special.gammainccinv(0.5 * trace.dof, level)
    needed = special.chndtrinc(critical, trace.dof, 1.0 - power)
    with np.errstate(divide="ignore"):
        return np.asarray(np.sqrt(needed) / np.linalg.norm(trace.size, axis=0))


def smallest_wander(trace: Trace, variance: np.ndarray, level: float, power: float) -> float:
    """Size of a wander that its score finds often enough.

    Parameters
    ----------
    trace : Trace
    variance : ndarray, shape (n,)
        Of the suspect's constants for a wander of size one (`inscal.suspects.wander_covariance`).
    level, power : float
        As of `smallest`.

    Returns
    -------
    float
        SI. The score's distribution is taken for a gamma of its mean and variance.
    """
    if trace.dof == 0:
        return np.inf
    critical = 2.0 * special.gammainccinv(0.5 * trace.dof, level)
    of_wander = np.linalg.eigvalsh((trace.size * variance) @ trace.size.T)

    def missed(logarithm: float) -> float:
        weight = 1.0 + np.exp(2.0 * logarithm) * of_wander
        mean, spread = weight.sum(), 2.0 * np.square(weight).sum()
        return float(special.gammainc(mean**2 / spread, critical * mean / spread) - 1.0 + power)

    about = -0.5 * np.log(of_wander.max())
    return float(np.exp(brentq(missed, about - 10.0, about + 20.0)))


def likeness(
    difference: np.ndarray, covariance: np.ndarray, moved: np.ndarray, variance: np.ndarray
) -> tuple[float, float]:
    """How much likelier a difference is with a suspect than without, and at which size of it.

    Parameters
    ----------
    difference : ndarray, shape (n,)
    covariance : ndarray, shape (n, n)
        Of it without the suspect, not singular.
    moved : ndarray, shape (n, m)
        What the suspect's constants do to it.
    variance : ndarray, shape (m,)
        Of the constants, at size one.

    Returns
    -------
    log_ratio : float
        Logarithm of the likelihood ratio at the likeliest size, at least 0.
    size : float
        The likeliest size.
    """
    sigma = np.sqrt(np.diag(covariance))
    root = np.linalg.cholesky(covariance / np.outer(sigma, sigma))
    whitened = np.linalg.solve(root, difference / sigma)
    basis, spread, _ = np.linalg.svd(
        np.linalg.solve(root, moved * np.sqrt(variance) / sigma[:, None]), full_matrices=False
    )
    if not spread.max() > 0.0:
        return 0.0, 0.0
    squared, unit = np.square(basis.T @ whitened), np.square(spread / spread.max())

    def worse(logarithm: float) -> float:
        grown = np.exp(2.0 * logarithm) * unit
        return float(-0.5 * np.sum(squared * grown / (1.0 + grown) - np.log1p(grown)))

    tried = np.linspace(-5.0, 15.0, 81)
    best = tried[int(np.argmin([worse(one) for one in tried]))]
    found = minimize_scalar(worse, bounds=(best - 0.25, best + 0.25), method="bounded")
    return max(0.0, -found.fun), float(np.exp(found.x) / spread.max())
