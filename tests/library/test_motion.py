import numpy as np
import pytest
from conftest import paper_schedule
from scipy.integrate import quad_vec

from inscal import earth
from inscal.motion import Site, attitude_at, build_motion, update_count
from inscal.schedule import segments

SITE = Site(np.deg2rad(39.98), 50.0)


def build(schedule, turn_step=0.1, dwell_step=1.0, update_interval=1.0):
    return build_motion(
        schedule,
        SITE,
        update_interval=update_interval,
        dwell_step=dwell_step,
        turn_step=turn_step,
    )


def test_increments_against_quadrature_of_the_motion():
    schedule = paper_schedule(3, position_duration=30.0)
    motion = build(schedule, turn_step=0.7)
    start = np.concatenate([[0.0], np.cumsum(motion.duration)])
    parts = segments(schedule)
    for i in range(0, motion.steps, 7):
        middle = 0.5 * (start[i] + start[i + 1])
        part = next(p for p in parts if p.start <= middle < p.end)

        def to_body(t, part=part):
            return attitude_at(part, np.array([t]))[0].T

        mean, _ = quad_vec(to_body, start[i], start[i + 1], epsabs=1e-14)
        angle = mean @ earth.earth_rate_ned(SITE.latitude) + part.rate * motion.duration[i]
        np.testing.assert_allclose(motion.angle[i], angle, atol=1e-15)
        force = mean @ -earth.gravity_ned(SITE.latitude, SITE.height)
        np.testing.assert_allclose(motion.velocity[i], force, atol=1e-13)


def test_steps_add_up_whatever_their_size():
    schedule = paper_schedule(4, position_duration=40.0)
    coarse, fine = build(schedule, turn_step=0.5), build(schedule, 0.01, 0.01)
    for k in range(coarse.updates):
        a = slice(coarse.update_step[k], coarse.update_step[k + 1])
        b = slice(fine.update_step[k], fine.update_step[k + 1])
        np.testing.assert_allclose(
            coarse.velocity[a].sum(axis=0), fine.velocity[b].sum(axis=0), atol=1e-12
        )
        np.testing.assert_allclose(
            coarse.angle[a].sum(axis=0), fine.angle[b].sum(axis=0), atol=1e-14
        )


def test_reference_step_counts():
    assert build(paper_schedule(), turn_step=0.01).steps == 12_176 + 32_400
    assert build(paper_schedule(), turn_step=0.1).updates == 12_500


def test_turn_that_ends_between_updates():
    schedule = paper_schedule(3, position_duration=20.0)
    odd = type(schedule)(schedule.initial_posture, schedule.turns, 20.0, np.deg2rad(17.0))
    motion = build(odd, turn_step=0.3)
    assert motion.duration.sum() == pytest.approx(60.0)
    assert motion.duration.min() > 1e-3
    boundaries = np.concatenate([[0.0], np.cumsum(motion.duration)])[motion.update_step]
    np.testing.assert_allclose(boundaries, np.arange(61.0), atol=1e-9)


def test_schedule_that_is_no_multiple_of_the_update_is_refused():
    with pytest.raises(ValueError, match="no multiple"):
        update_count(paper_schedule(3, position_duration=20.25), 1.0)
