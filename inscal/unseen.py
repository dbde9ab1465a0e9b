r"""What a record cannot tell apart: combinations of constants that it says nothing of.

With the prior's sigma D as unit, the final covariance of the constants is D C D. Of a combination
v of unit length C leaves v^T C v of its variance: an eigenvalue of 1 means that the record has not
seen it at all. Such combinations span a space; Gauss-Jordan elimination gives it the sparsest
basis there is, a vector for each of some chosen states, *pivots*, which no other vector has. A
pivot of a unit together with what else its vector holds is the error that leaves no trace: in
sigmas of the record alone

.. math:: d^2 = v^T (C^{-1} - I) v .
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

LEFT = 0.5
"""Share of its prior variance from which on a combination counts as not seen."""
EXACT = 1e-3
"""Sigmas below which a combination of prior size leaves no trace but rounding."""
_MEMBER = 0.3  # of a state's own final sigma: it belongs to a combination
_WORTH = 0.1  # of a unit vector: a pivot worth dividing by
_NEEDED = 10.0  # times the trace: so does one without which that would be seen


@dataclass(frozen=True)
class Unseen:
    """A combination of constants that the record does not tell from nothing.

    Attributes
    ----------
    members : tuple of int
        Places of the states in it, the pivot first, then by their share of their own sigma.
    values : ndarray
        Their errors together, SI, where the pivot's is its final sigma.
    trace : float
        Standard deviations at which the record sees them.
    """

    members: tuple[int, ...]
    values: np.ndarray
    trace: float

    @property
    def exact(self) -> bool:
        """Whether there is no trace at all."""
        return self.trace < EXACT


def unseen(
    covariance: np.ndarray, prior: np.ndarray, first_pivots: Sequence[int] = ()
) -> list[Unseen]:
    """Combinations that a record leaves as unknown as they were.

    Parameters
    ----------
    covariance : ndarray, shape (n, n)
        Final, of constants that are all modelled, SI.
    prior : ndarray, shape (n,)
        Standard deviations at the start.
    first_pivots : sequence of int
        States to be taken for pivots if they can be.

    Returns
    -------
    list of Unseen
        In the order of their pivots.
    """
    scaled = covariance / np.outer(prior, prior)
    left, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    basis = vectors[:, left > LEFT].T.copy()
    pivots = _reduce(basis, first_pivots)
    sigma = np.sqrt(np.diag(covariance))
    # what the record alone says; rounding leaves eigenvalues a little above 1
    information = np.where(left < 1.0, 1.0 / np.minimum(left, 1.0) - 1.0, 0.0)
    out = []
    for row, pivot in zip(basis, pivots, strict=True):
        v = row * (sigma[pivot] / prior[pivot]) / row[pivot]
        seen = vectors.T @ v
        trace = float(np.sqrt(information @ np.square(seen)))
        # what would be seen if one of them were not there
        without = np.sqrt(information @ np.square(seen[:, None] - vectors.T * v))
        size = np.abs(v * prior) / sigma
        belongs = (size > _MEMBER) | (without > _NEEDED * max(trace, EXACT))
        others = [int(j) for j in np.argsort(-size, kind="stable") if j != pivot]
        members = (pivot, *(j for j in others if belongs[j]))
        out.append(Unseen(members, (v * prior)[list(members)], trace))
    return sorted(out, key=lambda one: one.members[0])


def _reduce(basis: np.ndarray, first: Sequence[int]) -> list[int]:
    """Gauss-Jordan elimination of the rows in place; returns the pivot of each."""
    count = basis.shape[1]
    preferred, free = np.isin(np.arange(count), first), np.ones(count, dtype=bool)
    pivots: list[int] = []
    for row in range(len(basis)):
        size = np.abs(basis[row:]) * free
        wanted = size * preferred
        place = int(np.argmax(wanted if wanted.max() > _WORTH else size))
        found, pivot = row + place // count, place % count
        basis[[row, found]] = basis[[found, row]]
        basis[row] /= basis[row, pivot]
        others = np.arange(len(basis)) != row
        basis[others] -= np.outer(basis[others, pivot], basis[row])
        pivots.append(pivot)
        free[pivot] = False
    return pivots
