import dataclasses

import numpy as np
import pytest
from conftest import SITES, paper_schedule, paper_truth

from inscal import parameters
from inscal.calibrator import calibrate, empty_history
from inscal.estimator import Belief, build_estimator
from inscal.kernel import LANES
from inscal.motion import Site, build_motion
from inscal.record import Record
from inscal.recursion import InitialStd
from inscal.schedule import Schedule, turns_of
from inscal.simulation import Workspace, simulate
from inscal.state_model import NoiseModel

SITE = Site(np.deg2rad(39.98), 50.0)
NOISE = NoiseModel(1.5e-7, 5e-5, 1e-3, 0.1)
SIZE = paper_truth() * parameters.si_units(1673.84e-9)
STD = InitialStd(np.deg2rad([0.1, 0.1, 0.5]), 0.01, 1.0, SIZE)


def motion_of(schedule, turn_step=0.5, dwell_step=1.0):
    return build_motion(
        schedule, SITE, update_interval=1.0, dwell_step=dwell_step, turn_step=turn_step
    )


def estimator_of(schedule, passes=2):
    return build_estimator(schedule, SITE, Belief(NOISE, STD, passes=passes, update_interval=1.0))


def perfect_record(motion):
    increments = np.concatenate([motion.angle, motion.velocity], axis=1)
    return Record(
        sensors=np.repeat(increments[..., None], LANES, axis=2),
        observations=np.zeros((motion.updates, 6, LANES)),
        attitude=np.repeat(motion.initial_attitude[..., None], LANES, axis=2),
        velocity=np.zeros((3, LANES)),
        position=np.zeros((3, LANES)),
    )


@pytest.mark.parametrize("turn_step", [0.01, 0.5])
def test_no_errors_and_no_noise_stay_at_rest_for_the_whole_path(turn_step):
    schedule = paper_schedule()
    motion, estimator = motion_of(schedule, turn_step), estimator_of(schedule)
    history = empty_history(2, motion.updates)
    estimate = calibrate(perfect_record(motion), motion, SITE, estimator, history=history).estimate
    assert motion.duration.sum() == pytest.approx(12_500)
    # innovations are navigated velocity and position against zero
    assert np.abs(history.innovation[:, :, :3]).max() < 1e-6  # m/s
    assert np.abs(history.innovation[:, :, 3:]).max() < 1e-6  # m
    # and the estimates stay zero: to a thousandth of what the filter could ever tell
    assert (np.abs(estimate).max(axis=1) < 1e-3 * estimator.predicted_std).all()


@pytest.mark.parametrize("place", SITES)
@pytest.mark.parametrize("interval", [0.1, 10.0])
def test_no_errors_and_no_noise_stay_at_rest_elsewhere(place, interval):
    site = SITES[place]
    turns = turns_of([(-45.0, "Z"), (225.0, "X"), (-180.0, "Y"), (90.0, "Z")])
    schedule = Schedule(("West", "South", "Up"), turns, 40.0, np.deg2rad(15.0))
    motion = build_motion(schedule, site, update_interval=interval, dwell_step=2.0, turn_step=0.5)
    belief = Belief(NOISE, STD, passes=2, update_interval=interval)
    estimator = build_estimator(schedule, site, belief)
    history = empty_history(2, motion.updates)
    estimate = calibrate(perfect_record(motion), motion, site, estimator, history=history).estimate
    assert np.abs(history.innovation[:, :, :3]).max() < 1e-6  # m/s
    assert np.abs(history.innovation[:, :, 3:]).max() < 1e-6  # m
    assert (np.abs(estimate).max(axis=1) < 1e-3 * estimator.predicted_std).all()


def aggregate(record, fine, coarse):
    """The same record as a sensor with longer steps in the dwells would have given it."""
    start = np.concatenate([[0.0], np.cumsum(fine.duration)])[:-1]
    edges = np.concatenate([[0.0], np.cumsum(coarse.duration)])[:-1]
    group = np.searchsorted(edges, start + 1e-6) - 1
    sensors = np.zeros((coarse.steps, 6, LANES))
    np.add.at(sensors, group, record.sensors)
    return dataclasses.replace(record, sensors=sensors)


def test_aggregated_steps_against_full_rate():
    """One noise, seen at 100 Hz and in the default steps: the estimates must agree."""
    schedule = paper_schedule(8, position_duration=40.0)
    fine, coarse = motion_of(schedule, 0.01, 0.01), motion_of(schedule)
    assert fine.steps == 32_000
    assert coarse.steps < 420
    rng = np.random.default_rng(2)
    truth = SIZE[:, None] * rng.standard_normal((27, LANES))
    record = simulate(
        truth, fine, NOISE, STD, seed=4, runs=range(LANES), workspace=Workspace.of(fine)
    )
    estimator = estimator_of(schedule)
    full = calibrate(record, fine, SITE, estimator).estimate
    less = calibrate(aggregate(record, fine, coarse), coarse, SITE, estimator).estimate
    sigma = estimator.predicted_std[:, None]
    assert (np.abs(full - truth) / sigma).mean() > 0.5  # there are errors to compare
    assert (np.abs(full - less) / sigma).max() < 0.05


def test_second_pass_removes_what_the_first_leaves():
    """Errors without any noise: only the second-order terms are left, pass by pass."""
    schedule = paper_schedule(25, position_duration=60.0)
    motion = motion_of(schedule)
    silent = NoiseModel(0.0, 0.0, 0.0, 0.0)
    still = InitialStd(STD.attitude, 0.0, 0.0, STD.parameter)
    rng = np.random.default_rng(8)
    truth = SIZE[:, None] * rng.standard_normal((27, LANES))
    left = []
    for passes in (1, 2, 3):
        record = simulate(
            truth, motion, silent, still, seed=4, runs=range(LANES), workspace=Workspace.of(motion)
        )
        estimator = estimator_of(schedule, passes)
        estimate = calibrate(record, motion, SITE, estimator).estimate
        # what prior shrinkage explains is no defect of the linearisation
        sigma = estimator.predicted_std[:, None]
        left.append(np.abs((estimate - truth) / sigma).max())
    assert left[0] > 1.0
    assert left[1] < 0.3
    assert left[2] == pytest.approx(left[1], abs=0.02)


def test_a_lane_knows_nothing_of_its_neighbours():
    schedule = paper_schedule(3, position_duration=60.0)
    motion, estimator = motion_of(schedule), estimator_of(schedule)
    rng = np.random.default_rng(1)
    truth = SIZE[:, None] * rng.standard_normal((27, LANES))
    record = simulate(
        truth, motion, NOISE, STD, seed=4, runs=range(LANES), workspace=Workspace.of(motion)
    )
    together = calibrate(record, motion, SITE, estimator).estimate
    order = rng.permutation(LANES)
    shuffled = Record(**{name: value[..., order] for name, value in vars(record).items()})
    assert (calibrate(shuffled, motion, SITE, estimator).estimate == together[:, order]).all()
    # a neighbour that diverges harms nobody
    record.sensors[50, 4, 3] = np.nan
    broken = calibrate(record, motion, SITE, estimator).estimate
    others = np.arange(LANES) != 3
    assert not np.isfinite(broken[:, 3]).all()
    assert (broken[:, others] == together[:, others]).all()


def test_history_of_fewer_passes_than_there_are_is_that_of_the_first():
    schedule = paper_schedule(3, position_duration=60.0)
    motion, estimator = motion_of(schedule), estimator_of(schedule, passes=3)
    truth = np.repeat(SIZE[:, None], LANES, axis=1)
    record = simulate(
        truth, motion, NOISE, STD, seed=4, runs=range(LANES), workspace=Workspace.of(motion)
    )
    whole, part = empty_history(3, motion.updates), empty_history(2, motion.updates)
    estimate = calibrate(record, motion, SITE, estimator, history=whole).estimate
    assert (calibrate(record, motion, SITE, estimator, history=part).estimate == estimate).all()
    assert (part.estimate == whole.estimate[:2]).all()
    assert (part.innovation == whole.innovation[:2]).all()
    assert (whole.estimate[2, -1] != whole.estimate[1, -1]).any()


def test_history_ends_with_the_first_passs_estimate():
    schedule = paper_schedule(3, position_duration=60.0)
    motion, estimator = motion_of(schedule), estimator_of(schedule, passes=1)
    truth = np.repeat(SIZE[:, None], LANES, axis=1)
    record = simulate(
        truth, motion, NOISE, STD, seed=4, runs=range(LANES), workspace=Workspace.of(motion)
    )
    history = empty_history(1, motion.updates)
    estimate = calibrate(record, motion, SITE, estimator, history=history).estimate
    assert (history.estimate[0, -1] == estimate).all()
    assert (calibrate(record, motion, SITE, estimator).estimate == estimate).all()


def test_error_against_the_step_in_ramps():
    """The table of the manual: sensors without errors, in sigma, ramps of 20 deg/s^2."""
    schedule = dataclasses.replace(paper_schedule(), turn_acceleration=np.deg2rad(20.0))
    estimator, known, ignored = estimator_of(schedule), [], []
    for turn_step in (1.0, 0.5, 0.1):
        motion = motion_of(schedule, turn_step)
        unbent = dataclasses.replace(motion, ramp=np.zeros(motion.steps))
        for way, errors in ((motion, known), (unbent, ignored)):
            estimate = calibrate(perfect_record(motion), way, SITE, estimator).estimate
            errors.append((np.abs(estimate).max(axis=1) / estimator.predicted_std).max())
    assert known[0] < 1e-4
    assert known[0] > known[1] > known[2]
    assert ignored[1] > 30.0
    assert ignored[1] > 10.0 * ignored[2] > 1e4 * known[0]
