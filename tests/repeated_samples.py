"""What simulated samples need that are held against a stated confidence.

The tolerance is four standard errors of the simulated share: a right statistic passes 15999 times
out of 16000, whatever the seed.
"""

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

ERRORS = arrays(
    float,
    st.tuples(st.integers(2, 12), st.integers(1, 4)),
    elements=st.floats(0.01, 100.0).map(lambda x: x if x < 50.0 else 50.0 - x - 0.01),
)


def tolerance(share, trials):
    return 4.0 * np.sqrt(share * (1.0 - share) / trials)


def held(lower, truth, upper):
    return ((lower <= truth) & (truth <= upper)).mean()
