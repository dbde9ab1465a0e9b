"""Disturbances in the records of whole runs."""

import dataclasses

import numpy as np
import pytest
from conftest import paper_schedule, paper_truth
from scipy.spatial.transform import Rotation

from inscal import parameters
from inscal.disturbance import COMPONENTS, NOTHING, PROCESSES, Disturbance, draw_constants
from inscal.disturbed import disturb, true_noise
from inscal.estimator import Belief
from inscal.experiment import prepare, run
from inscal.free_inertial import fly
from inscal.kernel import LANES
from inscal.motion import Site
from inscal.path import path_of
from inscal.recursion import InitialStd
from inscal.schedule import attitudes
from inscal.simulation import Truth, TruthModel, Workspace, simulate
from inscal.state_model import NoiseModel
from inscal.wander import add_process

SITE = Site(np.deg2rad(39.98), 50.0)
NOISE = NoiseModel(1.5e-7, 5e-5, 1e-3, 0.1)
SIZE = paper_truth() * parameters.si_units(1673.84e-9)
STD = InitialStd(np.deg2rad([0.1, 0.1, 0.5]), 0.01, 1.0, SIZE)
SCHEDULE = paper_schedule(4, position_duration=60.0)
STEPS = {"dwell_step": 1.0, "turn_step": 0.2}
ALL = Disturbance(
    **dict.fromkeys((*COMPONENTS, *PROCESSES), 1e-6),
    **{"gyro_wander_time": 30.0, "accel_wander_time": 30.0, "vibration_frequency": 3.0},
    **{"gyro_quantisation": 5e-6, "accel_quantisation": 6e-4},
    **{"observation_correlation_time": 4.0, "gyro_noise_factor": 1.1, "velocity_noise_factor": 2.0},
)
RUNS = list(range(LANES))


def experiment_of(disturbance, **steps):
    return prepare(
        9,
        SCHEDULE,
        SITE,
        Truth(TruthModel("normal", SIZE), NOISE, STD, disturbance),
        Belief(NOISE, STD, passes=1, update_interval=1.0),
        **(STEPS | steps),
    )


@pytest.fixture(scope="module")
def plain():
    return experiment_of(NOTHING)


def recorded(experiment, runs=RUNS, noise=NOISE, motion=None):
    truth = np.tile(SIZE[:, None], LANES)
    record = simulate(
        truth,
        motion or experiment.motion,
        noise,
        STD,
        seed=9,
        runs=runs,
        workspace=Workspace.of(experiment.motion),
    )
    if experiment.disturbed is not None:
        experiment.disturbed.put_into(record, truth, seed=9, runs=runs)
    return record


def with_(plain, **sizes):
    about = Disturbance(**sizes)
    made = disturb(about, path_of(SCHEDULE, SITE, update_interval=1.0, **STEPS), 1.0)
    return dataclasses.replace(plain, disturbed=made)


def test_nothing_is_prepared_for_nothing(plain):
    assert plain.disturbed is None
    assert with_(plain, gyro_noise_factor=2.0, accel_wander_time=3.0).disturbed is None


def test_sensors_report_apparent_motion_as_they_would_the_true(plain):
    """Constants alike in all lanes are another motion, through all of the sensor model."""
    shaken = with_(plain, table_offset=0.02, gyro_g_sensitivity=1e-8, accel_cubic=1e-6)
    runs = [5] * LANES
    apparent = shaken.disturbed.apparent(shaken.disturbed.constants(9, runs), seed=9, runs=runs)
    assert (apparent == apparent[:, :, :1]).all()
    motion = dataclasses.replace(
        plain.motion,
        angle=plain.motion.angle + apparent[:, :3, 0],
        velocity=plain.motion.velocity + apparent[:, 3:, 0],
    )
    expected = recorded(plain, runs, motion=motion).sensors
    found = recorded(shaken, runs).sensors
    assert np.abs(found - recorded(plain, runs).sensors).max() > 1e-5
    np.testing.assert_allclose(found, expected, atol=3e-14)


def test_runs_do_not_depend_on_the_company_they_keep():
    disturbed = experiment_of(ALL)
    together = run(disturbed, [3, 40, 7, 256])
    for place, number in enumerate([3, 40, 7, 256]):
        assert run(disturbed, [number]).estimate.tobytes() == together.estimate[place].tobytes()


def test_disturbed_runs_are_paired_with_undisturbed_ones(plain):
    disturbed = with_(plain, accel_wander=1e-5, accel_wander_time=20.0)
    np.testing.assert_array_equal(recorded(plain).observations, recorded(disturbed).observations)
    change = recorded(disturbed).sensors - recorded(plain).sensors
    assert np.abs(change[:, :3]).max() < 1e-20
    # one source alone has the same draws as among all: the change is that of a smaller size
    half = with_(plain, accel_wander=5e-6, accel_wander_time=20.0, gyro_drift=1e-9)
    other = recorded(half).sensors - recorded(plain).sensors
    np.testing.assert_allclose(other[:, 3:], 0.5 * change[:, 3:], rtol=1e-6, atol=1e-11)
    assert run(experiment_of(ALL), [2]).truth.tobytes() == run(plain, [2]).truth.tobytes()


@pytest.mark.parametrize("source", [*COMPONENTS, *PROCESSES])
def test_every_source_has_a_stream_of_its_own_and_does_something(plain, source):
    extra = {"accel_wander_time": 30.0, "gyro_wander_time": 30.0, "vibration_frequency": 3.0}
    change = recorded(with_(plain, **{source: 1e-3}, **extra)), recorded(plain)
    moved = any(
        np.abs(getattr(change[0], key) - getattr(change[1], key)).max() > 0.0
        for key in ("sensors", "observations")
    )
    assert moved == (source != "observation_delay")  # of a place that rests


def test_constants_are_normal_with_the_size_as_sigma():
    about = Disturbance(gyro_g_sensitivity=3.0)
    drawn = draw_constants(about, "gyro_g_sensitivity", 3, seed=1, runs=range(400))
    assert drawn.shape == (9, 400)
    assert drawn.std() == pytest.approx(3.0, rel=5 / np.sqrt(2 * drawn.size))
    assert np.abs(np.corrcoef(drawn) - np.eye(9)).max() < 5 / np.sqrt(400)


def test_full_rate_and_aggregated_rests_are_disturbed_alike():
    """Constants do the same over a second whatever its steps."""
    sizes = {name: 1e-5 for name in COMPONENTS if name != "vibration"}
    quiet = NoiseModel(0.0, 0.0, 1e-3, 0.1)
    sums = []
    for steps in ({"dwell_step": 1.0, "turn_step": 0.01}, {"dwell_step": 0.01, "turn_step": 0.01}):
        experiment = experiment_of(Disturbance(**sizes), **steps)
        record = recorded(experiment, noise=quiet).sensors
        record = np.concatenate([np.zeros((1, 6, LANES)), np.cumsum(record, axis=0)])
        sums.append(np.diff(record[experiment.motion.update_step], axis=0))
    np.testing.assert_allclose(sums[0], sums[1], atol=2e-10)


def test_pulses_are_counted_and_the_remainder_is_carried(plain):
    counted = recorded(with_(plain, gyro_quantisation=5e-6, accel_quantisation=6e-4)).sensors
    whole = recorded(plain).sensors
    for part, pulse in ((slice(0, 3), 5e-6), (slice(3, 6), 6e-4)):
        pulses = counted[:, part] / pulse
        np.testing.assert_allclose(pulses, np.round(pulses), atol=1e-6)
        missing = np.cumsum(whole[:, part] - counted[:, part], axis=0)
        assert np.abs(missing).max() <= 0.5000001 * pulse
        assert np.abs(missing).max() > 0.45 * pulse


def test_correlated_observations_keep_their_size(plain):
    made = recorded(with_(plain, observation_correlation_time=4.0)).observations
    white = recorded(plain).observations
    expected = np.empty_like(made)
    expected[0], kept = white[0], np.exp(-0.25)
    for k in range(1, len(white)):
        expected[k] = kept * expected[k - 1] + np.sqrt(1 - kept**2) * white[k]
    np.testing.assert_allclose(made, expected, rtol=1e-12, atol=1e-15)


def test_observations_are_biased(plain):
    change = recorded(with_(plain, observation_bias=0.01)).observations
    change = change - recorded(plain).observations
    np.testing.assert_allclose(change, np.broadcast_to(change[:1], change.shape), atol=1e-15)
    assert not change[:, 3:].any()
    about = Disturbance(observation_bias=0.01)
    drawn = draw_constants(about, "observation_bias", 3, seed=9, runs=RUNS)
    np.testing.assert_allclose(change[0, :3], drawn, atol=1e-15)


def test_noise_factors_multiply_each_its_own_noise():
    about = Disturbance(
        gyro_noise_factor=2.0,
        accel_noise_factor=3.0,
        velocity_noise_factor=5.0,
        position_noise_factor=7.0,
    )
    expected = NoiseModel(
        2.0 * NOISE.gyro, 3.0 * NOISE.accel, 5.0 * NOISE.velocity, 7.0 * NOISE.position
    )
    assert true_noise(NOISE, about) == expected


def test_true_noise_is_larger_than_believed(plain):
    still = Disturbance(**{f"{x}_noise_factor": 3.0 for x in ("velocity", "position")})
    loud = run(experiment_of(still), RUNS)
    assert loud.nees.mean() > 2.0 * run(plain, RUNS).nees.mean()


@pytest.mark.parametrize(
    ("sizes", "message"),
    [
        ({"gravity": -1.0}, "gravity of -1: must be"),
        ({"accel_wander": 1.0}, "accel_wander needs a accel_wander_time above zero"),
        ({"vibration": np.inf}, "vibration of inf"),
    ],
)
def test_impossible_sizes_are_refused(sizes, message):
    with pytest.raises(ValueError, match=message):
        Disturbance(**sizes)


def test_a_unit_off_the_centre_is_navigated_along_its_arcs(plain):
    """Strapdown navigation finds the place C r that no observation says, by kinematics alone."""
    off = with_(plain, table_offset=0.1)
    runs, motion = [5] * LANES, plain.motion
    place = draw_constants(off.disturbed.disturbance, "table_offset", 3, seed=9, runs=[5])[:, 0]
    quiet, truth = NoiseModel(0.0, 0.0, 1e-3, 0.1), np.tile(SIZE[:, None], LANES)
    shaken = recorded(off, runs, noise=quiet)
    assert not (shaken.observations - recorded(plain, runs, noise=quiet).observations).any()
    flown = [
        fly(sensors, truth, motion, SITE, every=1).position[:, :, 0]
        for sensors in (shaken.sensors, recorded(plain, runs, noise=quiet).sensors)
    ]
    ends = np.cumsum(motion.duration)
    for turned, start in ((1, 60.0), (2, 120.0), (3, 180.0)):
        step = np.searchsorted(ends, start + 1e-6)
        arc = ((attitudes(SCHEDULE)[turned] - attitudes(SCHEDULE)[0]) @ place)[:2]
        np.testing.assert_allclose((flown[0] - flown[1])[step], arc, atol=4e-3)


@pytest.mark.parametrize("run", [0, 1, 2, 3])
def test_accelerometers_late_or_early_read_another_window(plain, run):
    """In the midst of a turn a window's increment is that of the body turned back by the delay."""
    (delay,) = draw_constants(
        Disturbance(gyro_accel_delay=0.004), "gyro_accel_delay", 3, seed=9, runs=[run]
    )[:, 0]
    quiet, motion = NoiseModel(0.0, 0.0, 1e-3, 0.1), plain.motion
    late = recorded(with_(plain, gyro_accel_delay=0.004), [run] * LANES, noise=quiet).sensors
    change = (late - recorded(plain, [run] * LANES, noise=quiet).sensors)[:, 3:, 0]
    turning = np.flatnonzero(np.abs(motion.angle).max(axis=1) > 0.01)
    inner = turning[np.isin(turning - 1, turning) & np.isin(turning + 1, turning)]
    rate = motion.angle[inner] / motion.duration[inner, None]
    turned = Rotation.from_rotvec(rate * delay).apply(motion.velocity[inner])
    expected = turned - motion.velocity[inner]
    assert np.abs(expected).max() > 1e-4
    # what sensors report of it is that to their scale factors
    np.testing.assert_allclose(change[inner], expected, atol=2e-3 * np.abs(expected).max())


@pytest.mark.parametrize("source", PROCESSES)
def test_a_record_has_the_wander_of_its_seed_and_run(plain, source):
    times = {"gyro_wander_time": 30.0, "accel_wander_time": 30.0}
    about, runs = with_(plain, **{source: 1e-5}, **times), list(range(70, 70 + LANES))
    wander = np.zeros((plain.motion.steps, 6, LANES))
    duration = plain.motion.duration
    add_process(wander, about.disturbed.disturbance, source, duration, seed=9, runs=runs)
    change = recorded(about, runs).sensors - recorded(plain, runs).sensors
    np.testing.assert_allclose(change, wander, atol=5e-3 * np.abs(wander).max())
