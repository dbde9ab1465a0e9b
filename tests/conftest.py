"""Shared fixtures: the reference case, read from the configuration like any campaign's."""

import pipeline  # isort: skip # noqa: F401 - it limits the threads of BLAS, before numpy is there

import dataclasses

import pytest
from hypothesis import settings

from inscal.schedule import Schedule
from pipeline.config.load import load
from pipeline.config.setup import Setup, parameter_vector

# compilation happens in the middle of an example; examples are the same in every run
settings.register_profile("inscal", deadline=None, derandomize=True)
settings.load_profile("inscal")


def paper_schedule(positions: int = 25, position_duration: float = 500.0) -> Schedule:
    """The paper's path, or its head, at a chosen pace."""
    schedule = Setup(load([])).schedule
    return dataclasses.replace(
        schedule, turns=schedule.turns[: positions - 1], position_duration=position_duration
    )


def paper_truth():
    """Truth of the paper's Table 3, shape (27,), in paper units."""
    return parameter_vector(load(["truth=paper"]).truth)


def paper_bounds():
    """Accuracy bounds of the paper's Table 3, shape (27,), in paper units."""
    return parameter_vector(load(["bounds=paper"]).bounds)


@pytest.fixture(scope="session")
def reference():
    """Configuration of the reference case."""
    return load([])
