import dataclasses

import numpy as np
import pytest
from conftest import SITES, paper_schedule
from scipy.spatial.transform import Rotation

from inscal import earth, navigation
from inscal.motion import Site, build_motion
from inscal.navigation import advance, rotate_left, site_constants, straightened
from inscal.rotation import (
    MAX_STEP_ANGLE,
    mean_rotation,
    mean_rotation_of_ramp,
    ramp_terms,
    skew,
)
from inscal.schedule import Schedule, attitudes, turns_of

SITE = Site(np.deg2rad(39.98), 50.0)
SCHULER = np.sqrt(9.8 / 6.37e6)


def still(attitude=None):
    state = np.zeros((navigation.ROWS, 1))
    state[:9, 0] = (np.eye(3) if attitude is None else attitude).ravel()
    return state


def at_rest(dt):
    """Increments of a body at rest, aligned North, East, Down."""
    angle = earth.earth_rate_ned(SITE.latitude) * dt
    return angle, -earth.gravity_ned(SITE.latitude, SITE.height) * dt


def test_stays_at_rest_through_every_turn_of_the_path():
    # unaided and without feedback: the vertical channel grows rounding errors by e per 570 s
    schedule = paper_schedule(25, position_duration=25.0)
    for turn_step in (0.1, 1.0):
        motion = build_motion(
            schedule, SITE, update_interval=1.0, dwell_step=1.0, turn_step=turn_step
        )
        state = still(motion.initial_attitude)
        for i in range(motion.steps):
            advance(
                state,
                0,
                0,
                tuple(motion.angle[i]),
                tuple(motion.velocity[i]),
                motion.duration[i],
                site_constants(SITE),
            )
        assert np.abs(state[9:12]).max() < 1e-8 * max(1.0, (turn_step / 0.1) ** 3)  # m/s


@pytest.mark.parametrize("place", SITES)
def test_stays_at_rest_at_every_site(place):
    site = SITES[place]
    turns = turns_of([(-45.0, "Z"), (270.0, "X"), (-180.0, "Y")])
    schedule = Schedule(("West", "South", "Up"), turns, 60.0, np.deg2rad(20.0))
    motion = build_motion(schedule, site, update_interval=2.0, dwell_step=2.0, turn_step=0.1)
    state = still(motion.initial_attitude)
    for angle, velocity, dt in zip(motion.angle, motion.velocity, motion.duration, strict=True):
        advance(state, 0, 0, tuple(angle), tuple(velocity), dt, site_constants(site))
    assert np.abs(state[9:12]).max() < 2e-8  # m/s
    assert np.abs(state[12:, 0] * site.metres).max() < 2e-6  # m


@pytest.mark.parametrize("place", ["laboratory", "south", "equator"])
@pytest.mark.parametrize("way", [(7.0, 0.0), (0.0, -9.0), (-4.0, 6.0)])
def test_moving_on_the_ellipsoid_against_its_own_frame(place, way):
    """One step of a body that moves level: rates and Coriolis by the frame's derivative."""
    site, dt = SITES[place], 0.01
    velocity = np.array([*way, 0.0])

    def frame(t):  # north, east, down in axes of inertial space
        latitude = site.latitude + velocity[0] * t / site.metres[0]
        longitude = velocity[1] * t / site.metres[1] + earth.EARTH_RATE * t
        s, c = np.sin(latitude), np.cos(latitude)
        turn = Rotation.from_rotvec([0.0, 0.0, longitude]).as_matrix()
        return turn @ np.array([[-s, 0.0, -c], [0.0, 1.0, 0.0], [c, 0.0, -s]])

    step = 1e-2
    spin = Rotation.from_matrix(frame(-step).T @ frame(step)).as_rotvec() / (2 * step)
    earth_rate = earth.earth_rate_ned(site.latitude)
    gravity = earth.gravity_ned(site.latitude, site.height)
    # what holds the velocity in the frame: force against gravity and Coriolis
    force = np.cross(earth_rate + spin, velocity) - gravity
    state = still()
    state[9:12, 0] = velocity
    advance(state, 0, 0, tuple(spin * dt), tuple(force * dt), dt, site_constants(site))
    np.testing.assert_allclose(state[:9, 0].reshape(3, 3), np.eye(3), atol=1e-12)
    np.testing.assert_allclose(state[9:12, 0], velocity, atol=1e-9)
    moved = state[12:, 0] * site.metres / dt
    np.testing.assert_allclose(moved, velocity, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("place", ["laboratory", "south", "equator"])
def test_an_offset_is_the_same_as_another_site(place):
    """Gravity, Earth rate and radii are those of where the navigation is, not of the site."""
    site, offset = SITES[place], np.array([4e-3, 0.0, 700.0])
    other = Site(site.latitude + offset[0], site.height + offset[2])
    rng = np.random.default_rng(5)
    there, here = still(), still()
    there[9:12, 0] = here[9:12, 0] = rng.uniform(-20, 20, 3)
    here[12:, 0] = offset
    for _ in range(20):
        angle, force = rng.uniform(-0.1, 0.1, 3), rng.uniform(-10, 10, 3)
        advance(there, 0, 0, tuple(angle), tuple(force), 1.0, site_constants(other))
        advance(here, 0, 0, tuple(angle), tuple(force), 1.0, site_constants(site))
    np.testing.assert_allclose(here[:12], there[:12], rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(here[12:, 0] - offset, there[12:, 0], rtol=1e-9, atol=1e-12)


def test_attitude_stays_orthonormal():
    schedule = paper_schedule(6, position_duration=25.0)
    motion = build_motion(schedule, SITE, update_interval=1.0, dwell_step=1.0, turn_step=0.05)
    state = still(motion.initial_attitude)
    for angle, velocity, dt in zip(motion.angle, motion.velocity, motion.duration, strict=True):
        advance(state, 0, 0, tuple(angle), tuple(velocity), dt, site_constants(SITE))
    c = state[:9, 0].reshape(3, 3)
    np.testing.assert_allclose(c @ c.T, np.eye(3), atol=1e-13)


def test_constant_acceleration_error_drives_a_schuler_oscillation():
    dt, error = 1.0, 1e-4
    angle, velocity = at_rest(dt)
    state = still()
    times = np.arange(1, 1801)
    north = np.empty(len(times))
    for k in range(len(times)):
        advance(
            state,
            0,
            0,
            tuple(angle),
            (velocity[0] + error * dt, velocity[1], velocity[2]),
            dt,
            site_constants(SITE),
        )
        state[11, 0], state[14, 0] = 0.0, 0.0  # height held
        north[k] = state[9, 0]
    # Earth rate couples north and east a little; within two per cent of the amplitude
    expected = error / SCHULER * np.sin(SCHULER * times)
    np.testing.assert_allclose(north, expected, atol=0.02 * error / SCHULER)


def test_free_vertical_channel_is_unstable_with_the_known_time_constant():
    angle, velocity = at_rest(1.0)
    state = still()
    state[14, 0] = 1e-3
    heights = []
    for _ in range(2400):
        advance(state, 0, 0, tuple(angle), tuple(velocity), 1.0, site_constants(SITE))
        heights.append(state[14, 0])
    growth = np.log(heights[-1] / heights[1199]) / 1200.0
    # a height error h brings 2 g h / R; the finite step adds half a per mille
    assert 1.0 / growth == pytest.approx(1.0 / np.sqrt(3.086e-6), rel=0.01)


def test_east_velocity_is_felt_as_coriolis_and_transport():
    dt, speed = 0.1, 10.0
    angle, velocity = at_rest(dt)
    state = still()
    state[10, 0] = speed
    advance(state, 0, 0, tuple(angle), tuple(velocity), dt, site_constants(SITE))
    sin_lat, cos_lat = np.sin(SITE.latitude), np.cos(SITE.latitude)
    _, prime_vertical = earth.radii_of_curvature(sin_lat)
    radius = prime_vertical + SITE.height
    north = -(2 * earth.EARTH_RATE * sin_lat + speed * sin_lat / cos_lat / radius) * speed
    # the attitude has turned against the frame by the transport rate, which tilts gravity north
    up = (2 * earth.EARTH_RATE * cos_lat + speed / radius) * speed
    assert state[9, 0] / dt == pytest.approx(north, rel=1e-3)
    assert state[11, 0] / dt == pytest.approx(-up, rel=1e-3)
    assert state[13, 0] == pytest.approx(speed * dt / radius / cos_lat, rel=1e-4)


@pytest.mark.parametrize("phi", [(0.2, -0.05, 0.1), (0.0, 0.2, 0.03), (-0.01, 0.02, 0.24)])
def test_rotate_left_of_large_angles_is_a_rotation(phi):
    before = Rotation.from_rotvec([0.3, -1.0, 2.0]).as_matrix()
    state = still(before)
    rotate_left(state, 0, 0, phi)
    expected = Rotation.from_rotvec(phi).as_matrix() @ before
    np.testing.assert_allclose(state[:9, 0].reshape(3, 3), expected, atol=1e-13)


def test_rotate_left_is_the_matrix_exponential():
    state = still(np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]], dtype=float))
    before = state[:9, 0].reshape(3, 3).copy()
    phi = np.array([1e-3, -2e-3, 3e-3])
    rotate_left(state, 0, 0, tuple(phi))
    first_and_second = np.eye(3) + skew(phi) + skew(phi) @ skew(phi) / 2
    np.testing.assert_allclose(state[:9, 0].reshape(3, 3), first_and_second @ before, atol=1e-8)


def at_rest_through(schedule, site, turn_step, *, knowing=True):
    """Velocity, m/s, after perfect increments of a schedule, unaided; ramps are known or not."""
    motion = build_motion(schedule, site, update_interval=2.0, dwell_step=2.0, turn_step=turn_step)
    state, about = still(motion.initial_attitude), site_constants(site)
    for s in range(motion.steps):
        step, dt = (tuple(motion.angle[s]), tuple(motion.velocity[s])), motion.duration[s]
        if motion.ramp[s] != 0.0 and knowing:
            step = straightened(state, 0, 0, *step, dt, about, motion.ramp_terms, s)
        advance(state, 0, 0, *step, dt, about)
    return np.abs(state[9:12]).max(), state[:9, 0].reshape(3, 3)


RAMPED = Schedule(
    ("West", "South", "Up"),
    turns_of([(-45.0, "Z"), (270.0, "X"), (-180.0, "Y")]),
    60.0,
    np.deg2rad(20.0),
    np.deg2rad(15.0),
)


@pytest.mark.parametrize("place", SITES)
def test_stays_at_rest_through_ramps_at_every_site(place):
    at_once = dataclasses.replace(RAMPED, turn_acceleration=None)
    for turn_step in (0.1, 0.3):
        steady, _ = at_rest_through(at_once, SITES[place], turn_step)
        bent, attitude = at_rest_through(RAMPED, SITES[place], turn_step)
        # no worse than in steady turns, where the frame's own turn is known to second order
        assert bent < max(1.5 * steady, 2e-8 * (turn_step / 0.1) ** 3)
        np.testing.assert_allclose(attitude, attitudes(RAMPED)[-1], atol=1e-9)


def test_velocity_error_in_ramps_falls_with_the_third_power_of_the_step():
    error = [at_rest_through(RAMPED, SITE, step)[0] for step in (0.6, 0.3, 0.15)]
    assert error[0] < 3e-6  # m/s
    assert error[0] > 5 * error[1] > 25 * error[2]


def test_ramps_taken_for_steady_turns_are_no_rest():
    unknown, _ = at_rest_through(RAMPED, SITE, 0.3, knowing=False)
    known, _ = at_rest_through(RAMPED, SITE, 0.3)
    # at the end, when ramps to rest have given back most of what ramps from rest took
    assert unknown > 3e-5  # m/s
    assert unknown > 100 * known


@pytest.mark.parametrize("ramp", [1.0, -1.0, 0.4])
def test_increments_of_a_ramp_become_those_of_a_steady_turn(ramp):
    """J(theta) J'^-1 of the largest step to rounding, where the Earth does not turn."""
    turned, velocity = np.array([0.12, -0.16, 0.15]), np.array([2.0, -5.0, 8.0])
    assert np.linalg.norm(turned) == pytest.approx(MAX_STEP_ANGLE)
    state, calm = still(np.eye(3)), (0.0,) * len(site_constants(SITE))
    terms = ramp_terms(np.array([ramp]))
    angle, found = straightened(state, 0, 0, tuple(turned), tuple(velocity), 0.5, calm, terms, 0)
    # a turn that runs backwards is J' from its other end
    bent = mean_rotation_of_ramp(turned[None], np.array([-ramp]))[0]
    expected = mean_rotation(turned) @ np.linalg.solve(bent, velocity)
    np.testing.assert_allclose(angle, turned, atol=1e-17)
    np.testing.assert_allclose(found, expected, atol=2e-12)
