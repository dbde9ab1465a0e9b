"""Normal errors of a known covariance, for the tests of the gate."""

import numpy as np

from inscal.parameters import COUNT


def some_covariance():
    rng = np.random.default_rng(1)
    root = np.eye(COUNT) + 0.2 * rng.standard_normal((COUNT, COUNT))
    return root @ root.T * np.logspace(-4, 4, COUNT)[:, None] * np.logspace(-4, 4, COUNT)


def normal_errors(rng, covariance, runs=128):
    return rng.standard_normal((runs, COUNT)) @ np.linalg.cholesky(covariance).T
