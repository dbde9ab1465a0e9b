"""Free inertial navigation with height held, against its own step taken one by one."""

import numpy as np
import pytest
from conftest import SITES, paper_truth

from inscal import kernel, navigation, parameters
from inscal.free_inertial import fly, initial_state, navigate
from inscal.motion import build_motion
from inscal.navigation import advance, site_constants
from inscal.recursion import InitialStd
from inscal.schedule import Schedule, turns_of
from inscal.sensor import compensate
from inscal.simulation import Workspace, simulate
from inscal.state_model import NoiseModel

SIZE = paper_truth() * parameters.si_units(1673.84e-9)
EVERY, LANES = 7, 3


@pytest.fixture(scope="module", params=["south", "laboratory"])
def flown(request):
    """A motion, its records with errors, what is known of them, and the flight."""
    site = SITES[request.param]
    schedule = Schedule(("West", "South", "Up"), turns_of([(-45.0, "Z"), (90.0, "X")]), 30.0, 0.2)
    motion = build_motion(schedule, site, update_interval=1.0, dwell_step=1.5, turn_step=0.4)
    rng = np.random.default_rng(4)
    true = np.concatenate([motion.angle, motion.velocity], axis=1)[..., None]
    sensors = true * (1 + 1e-3 * rng.standard_normal((motion.steps, 6, LANES)))
    known = SIZE[:, None] * rng.standard_normal((27, LANES))
    return site, motion, sensors, known, fly(sensors, known, motion, site, every=EVERY)


def steps_of(site, motion, sensors, known):
    """State of every lane after every step, shape (steps, 15, lanes)."""
    state = np.zeros((navigation.ROWS, LANES))
    state[:9] = motion.initial_attitude.reshape(9, 1)
    out = []
    for s in range(motion.steps):
        dt = motion.duration[s]
        for j in range(LANES):
            read = sensors[s, :, j]
            angle, velocity = compensate(known, j, tuple(read[:3]), tuple(read[3:]), dt)
            advance(state, 0, j, angle, velocity, dt, site_constants(site))
            state[11, j] = state[14, j] = 0.0
        out.append(state.copy())
    return np.array(out)


def test_course_is_that_of_single_steps(flown):
    site, motion, sensors, known, flight = flown
    seen = steps_of(site, motion, sensors, known)[EVERY - 1 :: EVERY]
    assert len(flight.time) == len(seen) == motion.steps // EVERY
    np.testing.assert_allclose(flight.time, np.cumsum(motion.duration)[EVERY - 1 :: EVERY])
    assert np.abs(flight.velocity).max() > 1e-3
    np.testing.assert_allclose(flight.velocity, seen[:, 9:11], rtol=1e-9, atol=1e-12)
    metres = site.metres[:2, None]
    np.testing.assert_allclose(flight.position, seen[:, 12:14] * metres, rtol=1e-9, atol=1e-9)


def test_in_ramps_the_true_parameters_keep_a_body_where_it_is():
    turns = turns_of([(-45.0, "Z"), (90.0, "X")])
    schedule = Schedule(("West", "South", "Up"), turns, 30.0, 0.2, 0.05)
    site = SITES["laboratory"]
    motion = build_motion(schedule, site, update_interval=1.0, dwell_step=1.0, turn_step=0.2)
    assert (motion.ramp != 0.0).any()
    truth = np.tile(SIZE[:, None], kernel.LANES)
    record = simulate(
        truth, motion, NoiseModel(0.0, 0.0, 0.0, 0.0), InitialStd(np.zeros(3), 0.0, 0.0, SIZE),
        seed=1, runs=range(kernel.LANES), workspace=Workspace.of(motion),
    )  # fmt: skip
    known, not_known = (fly(record.sensors, x, motion, site, every=1) for x in (truth, 0.0 * truth))
    assert np.abs(known.velocity).max() < 1e-5
    assert np.abs(not_known.velocity).max() > 1e-2


def test_a_record_may_come_in_pieces(flown):
    site, motion, sensors, known, flight = flown
    attitude = np.repeat(motion.initial_attitude[..., None], LANES, axis=2)
    state, parts = initial_state(attitude), []
    cut = 5 * EVERY
    for piece in (slice(0, cut), slice(cut, len(flight.time) * EVERY)):
        duration, terms = motion.duration[piece], motion.ramp_terms[piece]
        course = np.empty((len(duration) // EVERY, 4, LANES))
        navigate(state, sensors[piece], known, duration, terms, site_constants(site), EVERY, course)
        parts.append(course)
    assert (np.concatenate(parts)[:, :2] == flight.velocity).all()


def test_perfect_sensors_stay_where_they_are(flown):
    site, motion, *_ = flown
    true = np.concatenate([motion.angle, motion.velocity], axis=1)
    flight = fly(np.repeat(true[..., None], 2, axis=2), np.zeros((27, 2)), motion, site, every=1)
    assert len(flight.time) == motion.steps
    assert np.abs(flight.velocity).max() < 1e-6
    assert np.abs(flight.position).max() < 1e-4
