"""Ticks and labels of the page's charts."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.page.places import apart, ratio_ticks


@given(st.lists(st.floats(-5.0, 5.0), min_size=1, max_size=9), st.floats(0.01, 1.0))
def test_labels_stand_apart_in_their_order_and_no_further_than_that_takes(values, least):
    placed = np.array(apart(values, least))
    order = np.argsort(values, kind="stable")
    assert (np.diff(placed[order]) >= least - 1e-9).all()
    assert np.mean(placed) == pytest.approx(np.mean(values), abs=1e-9)


def test_labels_that_are_apart_stay():
    assert apart([3.0, 1.0, 2.0], 0.5) == [3.0, 1.0, 2.0]


@pytest.mark.parametrize("span", [(0.9, 1.1), (0.4, 1.0), (0.97, 1.02), (0.1, 30.0), (1.0, 1.9)])
def test_ticks_of_ratios_are_few_and_have_one(span):
    ticks = ratio_ticks(*span)
    assert 1.0 in ticks
    assert 1 <= len(ticks) <= 12
    assert all(span[0] <= tick <= span[1] for tick in ticks)
