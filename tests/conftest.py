"""Shared fixtures: the reference case, read from the configuration like any campaign's."""

import pipeline  # isort: skip # noqa: F401 - it limits the threads of BLAS, before numpy is there

import dataclasses
import os
from pathlib import Path

import numpy as np
import planted
import pytest
from campaigns import make
from hypothesis import settings

from inscal.motion import Site
from inscal.schedule import Schedule
from pipeline.config.load import load
from pipeline.config.setup import Setup, parameter_vector
from pipeline.gate import judge
from pipeline.gate.baseline import sample_of
from pipeline.gate.cases import cases

pytest_plugins = ["log_case"]

# compilation happens in the middle of an example; examples are the same in every run
settings.register_profile("inscal", deadline=None, derandomize=True)
settings.load_profile("inscal")


MOST_WORKERS = 4  # with more of them the manual alone decides how long the suite takes


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config):
    """Workers for folders of tests, and none for single files, for it takes seconds to start them.

    PYTEST_XDIST_AUTO_NUM_WORKERS and ``-n`` decide where they are given.
    """
    if "PYTEST_XDIST_AUTO_NUM_WORKERS" in os.environ:
        return None
    if not any(Path(argument).is_dir() for argument in config.args):
        return 0
    return min(os.cpu_count() or 1, MOST_WORKERS)


def pytest_collection_modifyitems(items):
    """Begin with the manual, the longest file: no worker is left with it when others are done."""
    items.sort(key=lambda item: item.path.stem != "test_manual")


SITES = {
    "laboratory": Site(np.deg2rad(39.98), 50.0),
    "south": Site(np.deg2rad(-40.0), 3000.0),
    "equator": Site(0.0, -400.0),
    "north pole": Site(np.deg2rad(89.9), 200.0),
    "south pole": Site(np.deg2rad(-89.5), 9000.0),
}
"""Sites that have no sign, no sine and no radius in common."""


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


@pytest.fixture(scope="session")
def short_store(tmp_path_factory):
    """Store of 30 runs of the short path, made by the default cluster in one batch."""
    return make(tmp_path_factory.mktemp("short") / "campaign")


@pytest.fixture(scope="session")
def clean():
    """The gate's campaign of this code."""
    return sample_of(planted.reference())


@pytest.fixture(scope="session")
def clean_cases(reference):
    """Every case of the gate, and its campaign of this code."""
    return [(case, judge.campaign(case)) for case in cases(reference)]


@pytest.fixture(scope="session")
def bound(reference):
    """Accuracy bounds of the reference case in SI."""
    return Setup(reference).bound * Setup(reference).unit
