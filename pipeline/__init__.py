"""Monte Carlo pipeline around :mod:`inscal`: configuration, stages, stores, clusters."""
