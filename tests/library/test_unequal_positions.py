"""Positions of unequal length and turns of their own rates, against the same path put otherwise."""

import numpy as np
import pytest
from conftest import paper_truth

from inscal import parameters
from inscal.estimator import Belief
from inscal.experiment import prepare, run
from inscal.motion import Site, build_motion
from inscal.recursion import InitialStd
from inscal.schedule import Schedule, segments, turns_of
from inscal.simulation import Truth, TruthModel
from inscal.state_model import NoiseModel

SITE = Site(np.deg2rad(39.98), 50.0)
NOISE = NoiseModel(1.5e-7, 5e-5, 1e-3, 0.1)
SIZE = 0.1 * paper_truth() * parameters.si_units(1673.84e-9)
STD = InitialStd(np.deg2rad([0.01, 0.01, 0.05]), 0.01, 1.0, SIZE)
POSTURE = ("North", "East", "Down")
STEPS = {"update_interval": 1.0, "dwell_step": 1.0, "turn_step": 0.5}
RATE = np.deg2rad(10.0)


def path(rotations, duration=60.0, rate=RATE, last=None):
    return Schedule(POSTURE, turns_of(rotations), duration, rate, None, last)


def test_said_of_every_turn_it_is_the_same_as_said_once():
    plain = path([(90, "Y"), (180, "X"), (45, "Z")])
    said = [(90, "Y", 60.0, 10.0), (180, "X", 60.0, 10.0), (45, "Z", 60.0, 10.0)]
    own = path(said, 7.0, 1.0, 60.0)
    one, other = (build_motion(p, SITE, **STEPS) for p in (plain, own))
    for name in ("duration", "angle", "velocity", "update_step"):
        assert (getattr(one, name) == getattr(other, name)).all()


def test_times_are_those_of_each_position():
    made = path([(90, "Y", 40.0), (-180, "X", None, 20.0), (33.0, "Z", 25.0, 11.0)], last=10.0)
    assert made.durations.tolist() == [40.0, 60.0, 25.0, 10.0]
    assert made.ends.tolist() == [40.0, 100.0, 125.0, 135.0]
    assert made.duration == 135.0
    turns = [segment for segment in segments(made) if segment.is_turn]
    assert [segment.end for segment in turns] == [40.0, 100.0, 125.0]
    np.testing.assert_allclose([t.end - t.start for t in turns], [9.0, 9.0, 3.0])
    rates = [np.rad2deg(np.linalg.norm(segment.rate)) for segment in turns]
    np.testing.assert_allclose(rates, [10.0, 20.0, 11.0])


def test_a_dwell_cut_in_two_by_a_whole_turn_knows_more_and_a_longer_one_too():
    """Sigma falls with time wherever it is spent; a path in order of time is what is simulated."""
    short = path([(90, "Y"), (180, "X"), (90, "Z")])
    longer = path([(90, "Y", 240.0), (180, "X", 90.0), (90, "Z")], last=120.0)
    sigma = []
    for one in (short, longer):
        experiment = prepare(
            1, one, SITE, Truth(TruthModel("normal", SIZE), NOISE, STD),
            Belief(NOISE, STD, passes=2, update_interval=1.0), dwell_step=1.0, turn_step=0.5,
        )  # fmt: skip
        outcome = run(experiment, range(256))
        sigma.append(experiment.estimator.predicted_std)
        assert outcome.nees.mean() == pytest.approx(27.0, abs=5.0 * np.sqrt(54.0 / 256))
    assert (sigma[1] < sigma[0]).all()
