"""First guess of a unit whose scales are off by percents: found again in a made-up record."""

import numpy as np
from conftest import paper_schedule

from inscal import earth
from inscal.first_guess import composed, first_guess
from inscal.motion import Site
from inscal.parameters import COUNT, INDEX
from inscal.recorded import Increments, compensated, stretches
from inscal.schedule import attitudes
from inscal.sensor import matrices

SITE = Site(np.deg2rad(45.0), 100.0)
INTERVAL = 0.02


def perfect():
    """Increments of a unit without errors on 19 positions of 6 s, the Earth not turning."""
    gravity = earth.gravity_ned(SITE.latitude, SITE.height)
    schedule = paper_schedule(19, position_duration=6.0)
    angle, velocity = [], []
    postures = attitudes(schedule)
    for posture, turn in zip(postures, [*schedule.turns, None], strict=True):
        rest = round(6.0 / INTERVAL)
        angle.append(np.zeros((rest, 3)))
        velocity.append(np.tile(-posture.T @ gravity * INTERVAL, (rest, 1)))
        if turn is not None:
            steps = round(abs(turn.angle) / np.deg2rad(40.0) / INTERVAL)
            step = np.zeros(3)
            step[turn.axis] = turn.angle / steps
            angle.append(np.tile(step, (steps, 1)))
            velocity.append(np.tile(-posture.T @ gravity * INTERVAL, (steps, 1)))
    return Increments(INTERVAL, np.concatenate(angle), np.concatenate(velocity))


def errors(scale):
    rng, out = np.random.default_rng(5), np.zeros(COUNT)
    out[INDEX["gyro_bias"]] = 0.02 * rng.standard_normal(3)
    out[INDEX["accel_bias"]] = 0.3 * rng.standard_normal(3)
    out[INDEX["gyro_k"]] = scale * rng.standard_normal(6)
    out[INDEX["accel_k"]] = scale * rng.standard_normal(9)
    return out


def reported(record, truth):
    """What a unit with these errors reports: the inverse of their compensation."""
    gyro, accel = (np.linalg.inv(np.eye(3) + m) for m in matrices(truth[:, None])[:, 0])
    bias = truth[:6].reshape(2, 3) * record.interval
    return Increments(
        record.interval, (record.angle - bias[0]) @ gyro.T, (record.velocity - bias[1]) @ accel.T
    )


def test_errors_of_percents_are_found():
    truth = errors(0.03)
    record = reported(perfect(), truth)
    found = first_guess(record, stretches(record), SITE)
    np.testing.assert_allclose(found[:3], truth[:3], atol=2e-5)
    np.testing.assert_allclose(found[3:6], truth[3:6], atol=2e-3)
    np.testing.assert_allclose(found[6:21], truth[6:21], atol=5e-4)
    assert (found[21:] == 0.0).all()


def test_two_compensations_are_one():
    first, then = errors(0.05), errors(0.01)[::-1].copy()
    then[:6] *= 0.1
    record = perfect()
    twice = compensated(compensated(record, first), then)
    once = compensated(record, composed(first, then))
    np.testing.assert_allclose(once.angle, twice.angle, atol=1e-15)
    np.testing.assert_allclose(once.velocity, twice.velocity, atol=1e-13)
    assert (composed(first, then)[21:] == then[21:]).all()
