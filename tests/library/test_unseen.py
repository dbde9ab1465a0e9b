"""What a record does not tell apart: made-up covariances, and where physics says so."""

import numpy as np
import pytest

from inscal.unseen import unseen

PRIOR = np.array([1.0, 2.0, 3.0, 0.5, 10.0])


def covariance_of(*seen, noise=1e-3):
    """Of a record that shows some combinations, given in prior units, with little noise."""
    information = np.eye(len(PRIOR))
    for row in seen:
        information += np.outer(row, row) / noise**2
    return np.outer(PRIOR, PRIOR) * np.linalg.inv(information)


def test_where_all_is_seen_there_is_nothing():
    assert unseen(covariance_of(*np.eye(5)), PRIOR) == []


@pytest.mark.parametrize("pivot", [0, 4])
def test_a_sum_alone_is_seen(pivot):
    """Of the first and the last state only the sum: their difference is a combination."""
    rest = np.eye(5)[1:4]
    (one,) = unseen(covariance_of([1, 0, 0, 0, 1], *rest), PRIOR, [pivot])
    assert one.exact
    assert one.members == (pivot, 4 - pivot)
    sigma = PRIOR[[pivot, 4 - pivot]] / np.sqrt(2.0)  # half of the variance of each is left
    np.testing.assert_allclose(one.values, sigma * [1, -1], rtol=1e-4)


def test_several_come_in_the_sparsest_basis():
    """States 3 and 4 hide in 0 and in 1 and 2: an arbitrary basis of these would mix them."""
    seen = [[1, 0, 0, 1, 0], [0, 1, 0, 0, 0.3], [0, 0, 1, 0, 0.2]]
    first, second = unseen(covariance_of(*seen), PRIOR, [3, 4])
    assert (first.members, set(second.members)) == ((3, 0), {4, 1, 2})
    ratio = dict(zip(second.members, second.values / PRIOR[list(second.members)], strict=True))
    assert ratio[1] / ratio[4] == pytest.approx(-0.3, rel=1e-3)
    assert ratio[2] / ratio[4] == pytest.approx(-0.2, rel=1e-3)


def test_a_trace_is_what_the_record_alone_sees():
    """A difference seen weakly, at a tenth of a sigma of prior size."""
    rows = [[1, 1, 0, 0, 0], *np.eye(5)[2:]]
    weak = 0.1 * 1e-3 * np.array([1, -1, 0, 0, 0]) / np.sqrt(2.0)
    (one,) = unseen(covariance_of(*rows, weak), PRIOR)
    assert not one.exact
    size = np.linalg.norm(one.values / PRIOR[list(one.members)])
    assert one.trace == pytest.approx(0.1 * size, rel=1e-3)


def test_a_small_share_belongs_where_it_is_needed():
    """State 0 is known badly for its own reasons; without its part the rest would be seen."""
    rows = [[1e-2, 0, 0, 0, 1e-2], *np.eye(5)[1:4], [0, 0, 0, 0, 1e-6]]
    found = unseen(covariance_of(*rows, noise=1e-4), PRIOR, [4])
    assert [one.members for one in found] == [(4, 0)]
