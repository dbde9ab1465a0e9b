import dataclasses

import numpy as np
import pytest
from conftest import SITES, paper_schedule
from scipy.integrate import quad_vec
from scipy.spatial.transform import Rotation

from inscal import earth
from inscal.motion import Site, attitude_at, build_motion, cut_into_steps, update_count
from inscal.schedule import Schedule, segments, turn_vector, turns_of

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


@pytest.mark.parametrize("place", SITES)
@pytest.mark.parametrize("interval", [0.1, 1.6, 10.0])
def test_whole_turns_and_dwells_against_what_the_earth_gives(place, interval):
    """In axes of the Earth all rates and forces add up, whatever the way and the intervals."""
    site = SITES[place]
    turns = turns_of([(-45.0, "Z"), (225.0, "X"), (-360.0, "Y"), (-90.0, "X")])
    schedule = Schedule(("West", "South", "Up"), turns, 80.0, np.deg2rad(7.0))
    motion = build_motion(schedule, site, update_interval=interval, dwell_step=2.0, turn_step=0.3)
    assert motion.updates == round(400.0 / interval)
    ends = np.cumsum(motion.duration)[motion.update_step[1:] - 1]
    np.testing.assert_allclose(ends, interval * np.arange(1, motion.updates + 1), atol=1e-9)
    assert motion.duration.max() <= min(2.0, interval) + 1e-9
    # the attitude that the increments lead to is that of the schedule
    attitude = motion.initial_attitude
    frame = earth.earth_rate_ned(site.latitude)
    force = np.zeros(3)
    for angle, velocity, dt in zip(motion.angle, motion.velocity, motion.duration, strict=True):
        halfway = attitude @ Rotation.from_rotvec(0.5 * angle).as_matrix()
        attitude = Rotation.from_rotvec(-frame * dt).as_matrix() @ attitude
        attitude = attitude @ Rotation.from_rotvec(angle).as_matrix()
        force += halfway @ velocity
    last = segments(schedule)[-1]
    np.testing.assert_allclose(attitude, last.attitude, atol=2e-3)
    expected = -earth.gravity_ned(site.latitude, site.height) * 400.0
    np.testing.assert_allclose(force, expected, atol=0.02 * 400.0)


@pytest.mark.parametrize("place", SITES)
def test_metres_are_arcs_of_the_ellipsoid(place):
    site = SITES[place]

    def point(latitude, longitude, height):
        n = earth.radii_of_curvature(np.sin(latitude))[1]
        east = (n + height) * np.cos(latitude)
        up = (n * (1 - earth.ECCENTRICITY_SQUARED) + height) * np.sin(latitude)
        return np.array([east * np.cos(longitude), east * np.sin(longitude), up])

    for axis, step in enumerate((1e-4, 1e-4, 100.0)):
        away = step * np.eye(3)[axis]
        ends = [point(*([site.latitude, 0.0, site.height] + s * away)) for s in (1, -1)]
        expected = np.linalg.norm(ends[0] - ends[1]) / (2 * step)
        assert site.metres[axis] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("degrees", [89.991, -90.0])
def test_no_site_where_north_is_no_direction(degrees):
    with pytest.raises(ValueError, match=r"reach to 89\.99 deg"):
        Site(np.deg2rad(degrees), 0.0)


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


def turned(t, angle, rate, acceleration, end):
    """Angle at time t of a turn that ends at `end`, from how far the table gets by then."""
    ramp = min(rate / acceleration, np.sqrt(angle / acceleration))
    top = acceleration * ramp
    duration = ramp + angle / top
    since, left = t - (end - duration), end - t
    if since <= 0 or left <= 0:
        return 0.0 if since <= 0 else angle
    if since < ramp:
        return 0.5 * acceleration * since**2
    if left < ramp:
        return angle - 0.5 * acceleration * left**2
    return 0.5 * top * ramp + top * (since - ramp)


@pytest.mark.parametrize(("rate", "acceleration"), [(10.0, 20.0), (30.0, 7.0), (60.0, 15.0)])
def test_increments_of_ramps_against_fine_integration(rate, acceleration):
    """Of the rate's integral in a formula of its own; trapezoids and, of 45 degrees, triangles."""
    about = [(-90.0, "Y"), (45.0, "Z"), (180.0, "X")]
    schedule = Schedule(
        ("West", "South", "Up"), turns_of(about), 40.0, np.deg2rad(rate), np.deg2rad(acceleration)
    )
    motion = build(schedule, turn_step=0.23)
    start = np.concatenate([[0.0], np.cumsum(motion.duration)])
    bent = np.flatnonzero(motion.ramp)
    assert len(bent) >= 18
    for i in [*bent[::3], *range(0, motion.steps, 40)]:
        number = min(int(0.5 * (start[i] + start[i + 1]) / 40.0), len(about) - 1)
        degrees, axis = about[number]
        amount, end = abs(degrees), 40.0 * (number + 1)
        along = np.sign(degrees) * np.eye(3)["XYZ".index(axis)]
        rest = segments(schedule)[0].attitude
        for angle, name in about[:number]:
            rest = rest @ Rotation.from_euler(name.lower(), angle, degrees=True).as_matrix()

        def angle_at(t, amount=amount, end=end):
            return np.deg2rad(turned(t, amount, rate, acceleration, end))

        def to_body(t, rest=rest, along=along, angle_at=angle_at):
            return (rest @ Rotation.from_rotvec(along * angle_at(t)).as_matrix()).T

        mean, _ = quad_vec(to_body, start[i], start[i + 1], epsabs=1e-15, epsrel=1e-14)
        force = mean @ -earth.gravity_ned(SITE.latitude, SITE.height)
        np.testing.assert_allclose(
            motion.velocity[i], force, rtol=0, atol=1e-12 * np.linalg.norm(force)
        )
        turn = along * (angle_at(start[i + 1]) - angle_at(start[i]))
        angle = mean @ earth.earth_rate_ned(SITE.latitude) + turn
        np.testing.assert_allclose(motion.angle[i], angle, rtol=0, atol=1e-13)


def test_ramps_of_a_path_end_in_its_attitudes():
    ramped = dataclasses.replace(paper_schedule(), turn_acceleration=np.deg2rad(20.0))
    steps = cut_into_steps(ramped, update_interval=1.0, dwell_step=1.0, turn_step=0.3)
    whole = np.zeros((24, 3))
    for number in range(24):
        own = steps.turn == number
        whole[number] = (steps.rate[own] * steps.duration[own, None]).sum(axis=0)
    expected = [turn_vector(turn) for turn in ramped.turns]
    np.testing.assert_allclose(whole, expected, atol=1e-12)
    # the rate goes up and down in each, without a jump between two steps
    moving = np.flatnonzero(steps.turn >= 0)
    before = steps.rate * (1.0 - steps.ramp)[:, None]
    after = steps.rate * (1.0 + steps.ramp)[:, None]
    np.testing.assert_allclose(before[moving], after[moving - 1], atol=1e-11)
    assert np.abs(after).max() == pytest.approx(ramped.turn_rate)


def test_without_ramps_no_step_has_one():
    assert not build(paper_schedule(4, position_duration=40.0)).ramp.any()
    assert not build(paper_schedule(4, position_duration=40.0)).ramp_terms.any()
