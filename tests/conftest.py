"""Shared fixtures: the reference case, read from the configuration like any campaign's."""

import pipeline  # isort: skip # noqa: F401 - it limits the threads of BLAS, before numpy is there

import dataclasses

import pytest
from hypothesis import settings

from inscal.schedule import Schedule
from pipeline.config.load import load
from pipeline.config.setup import Setup

# compilation happens in the middle of an example; examples are the same in every run
settings.register_profile("inscal", deadline=None, derandomize=True)
settings.load_profile("inscal")


def paper_schedule(positions: int = 25, position_duration: float = 500.0) -> Schedule:
    """The paper's path, or its head, at a chosen pace."""
    schedule = Setup(load([])).schedule
    return dataclasses.replace(
        schedule, turns=schedule.turns[: positions - 1], position_duration=position_duration
    )


@pytest.fixture(scope="session")
def reference():
    """Configuration of the reference case."""
    return load([])
