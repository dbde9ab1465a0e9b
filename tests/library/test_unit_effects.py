"""What every constant disturbance does to a record, against quadrature of what it is."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from walked_path import parts_of, seen, walk

from inscal import earth
from inscal.disturbance import COMPONENTS, Disturbance
from inscal.motion import Site, build_motion, cut_into_steps
from inscal.path import Path
from inscal.rotation import mean_rotation_of_ramp
from inscal.schedule import Schedule, turns_of
from inscal.unit_effects import DELAY_TERMS, delay_series, effect, trend

SITE = Site(np.deg2rad(-33.0), 900.0)
SCHEDULE = Schedule(
    ("East", "North", "Up"),
    turns_of([(45.0, "Z"), (-90.0, "X"), (180.0, "Y")]),
    20.0,
    np.deg2rad(20.0),
)
RAMPED = replace(SCHEDULE, turn_acceleration=np.deg2rad(30.0))
STEPS = {"update_interval": 1.0, "dwell_step": 1.0, "turn_step": 0.25}
ABOUT = Disturbance(vibration=1.0, vibration_frequency=3.7)
OTHERS = ((1, 2), (0, 2), (0, 1))


def path_of(schedule, steps):
    return Path(cut_into_steps(schedule, **steps), build_motion(schedule, SITE, **steps), SITE)


@pytest.fixture(scope="module", params=[SCHEDULE, RAMPED], ids=["at once", "ramps"])
def schedule(request):
    return request.param


@pytest.fixture(scope="module")
def path(schedule):
    return path_of(schedule, STEPS)


@pytest.fixture(scope="module")
def parts(schedule):
    return parts_of(schedule)


def increments(path, parts, **of_the_site):
    return walk(SITE, parts, path.edges, seen(SITE, **of_the_site))


def sensed(path, parts, function):
    """Integral of a function of (rate, force), six of each step."""
    both = seen(SITE)

    def value(t, part):
        now = both(t, part)
        return function(now[:3], now[3:])

    return walk(SITE, parts, path.edges, value)


def test_the_walk_is_the_motion(path, parts):
    both = np.concatenate([path.motion.angle, path.motion.velocity], axis=1)
    np.testing.assert_allclose(increments(path, parts), both, atol=2e-12)


def test_every_source_has_its_components(path):
    for source, count in COMPONENTS.items():
        rows = effect(path, ABOUT, source)
        assert rows.increments.shape == (count or 3, path.motion.steps, 6), source
        assert rows.observations.shape == (count or 3, 6)
        observed = source == "observation_bias"
        assert rows.observations.any() == observed
        assert rows.increments.any() == (not observed and source != "observation_delay")


FORCE_TERMS = {
    "accel_asymmetry": [lambda f, i=i: (i, 0.5 * abs(f[i])) for i in range(3)],
    "accel_cubic": [lambda f, i=i: (i, f[i] ** 3) for i in range(3)],
    "accel_cross_coupling": [
        lambda f, i=i, j=j: (i, f[i] * f[j]) for i in range(3) for j in OTHERS[i]
    ],
    "accel_pendulous": [lambda f, i=i, j=j: (i, f[j] ** 2) for i in range(3) for j in OTHERS[i]],
}


@pytest.mark.parametrize("source", FORCE_TERMS)
def test_terms_of_accelerometers_are_integrals_of_the_turning_force(path, parts, source):
    rows = effect(path, ABOUT, source).increments
    for row, term in zip(rows, FORCE_TERMS[source], strict=True):
        expected = np.zeros((path.motion.steps, 6))
        axis, _ = term(np.zeros(3))
        expected[:, 3 + axis] = sensed(path, parts, lambda w, f, term=term: [term(f)[1]])[:, 0]
        # |f| has a corner where it changes its sign within a step
        np.testing.assert_allclose(-row, expected, atol=5e-3 if source[6] == "a" else 1e-9)


def test_gyro_terms(path, parts):
    rows = effect(path, ABOUT, "gyro_asymmetry").increments
    expected = sensed(path, parts, lambda w, f: 0.5 * np.abs(w))
    for i in range(3):
        assert not np.delete(rows[i], i, axis=1).any()
        np.testing.assert_allclose(-rows[i][:, i], expected[:, i], atol=1e-6)
    rows = effect(path, ABOUT, "gyro_g_sensitivity").increments
    force = sensed(path, parts, lambda w, f: f)
    for i in range(3):
        for j in range(3):
            assert not np.delete(rows[3 * i + j], i, axis=1).any()
            np.testing.assert_allclose(-rows[3 * i + j][:, i], force[:, j], atol=1e-11)


@pytest.mark.parametrize("time", [0.0, 15.0])
def test_drifts_move_by_one_and_have_no_mean(path, parts, time):
    def s(t):
        if time == 0.0:
            return t / path.edges[-1] - 0.5
        k = path.edges[-1] / time
        mean = 1.0 - (1.0 - np.exp(-k)) / k
        return (1.0 - np.exp(-t / time) - mean) / (1.0 - np.exp(-k))

    assert s(path.edges[-1]) - s(0.0) == pytest.approx(1.0)
    assert trend(path.edges, time).sum() == pytest.approx(0.0, abs=1e-12)
    about = Disturbance(drift_time=time)
    expected = walk(SITE, parts, path.edges, lambda t, part: [s(t)])[:, 0]
    for source, first in (("gyro_drift", 0), ("accel_drift", 3)):
        rows = effect(path, about, source).increments
        for i in range(3):
            np.testing.assert_allclose(-rows[i][:, first + i], expected, atol=1e-12)
            assert not np.delete(rows[i], first + i, axis=1).any()
    both = seen(SITE)
    scaled = walk(SITE, parts, path.edges, lambda t, part: s(t) * both(t, part))
    for source, first in (("gyro_scale_drift", 0), ("accel_scale_drift", 3)):
        rows = effect(path, about, source).increments
        for i in range(3):
            # in a turn f varies within a step, by less than the trend does over all
            np.testing.assert_allclose(-rows[i][:, first + i], scaled[:, first + i], atol=2e-3)


def test_at_rest_a_place_feels_the_earth_spin(path):
    place = np.array([0.3, -0.2, 0.5])
    row = np.tensordot(place, effect(path, ABOUT, "table_offset").increments, axes=1)
    assert not row[:, :3].any()
    for s in np.flatnonzero(path.steps.turn < 0):
        w = path.steps.attitude[s].T @ path.earth_rate
        spin = np.cross(w, np.cross(w, place)) * path.motion.duration[s]
        np.testing.assert_allclose(row[s, 3:], spin, atol=1e-18)


@pytest.mark.parametrize("step", [0.02, 0.25, 0.5])
def test_a_turn_takes_a_point_along_its_arc_at_any_step(schedule, step):
    """Velocity C (w x r) of a point of the body at every step of a turn, and none before or after.

    As navigation has it: in the axes at the end of a step, C J(theta)^-1 of the increment.
    """
    place, path = np.array([0.3, -0.2, 0.5]), path_of(schedule, STEPS | {"turn_step": step})
    steps, rate = path.steps, path.edge_rates[1]
    row = np.tensordot(place, effect(path, ABOUT, "table_offset").increments, axes=1)[:, 3:]
    turned = steps.rate * steps.duration[:, None]
    # the mean of exp((1 - s) [theta x]): of J_kappa of a turn that runs backwards
    inverse = np.linalg.inv(mean_rotation_of_ramp(turned, -steps.ramp))
    gained = np.einsum("sij,sjk,sk->si", path.end_attitude, inverse, row)
    found = np.cumsum(gained, axis=0)
    last = steps.turn != np.append(steps.turn[1:], -1)
    expected = (path.end_attitude @ np.cross(rate, place)[..., None])[..., 0]
    expected[last] = 0.0
    size = np.linalg.norm(expected, axis=1).max()
    # the centripetal force turns with the body: of second order in a step; and the Earth turns
    np.testing.assert_allclose(found, expected, atol=size * max(0.03 * step**2, 1e-3))


def test_off_axis_arms_are_parts_of_a_displacement(path):
    """All that accelerometers of one place feel is what each feels, and each its own axis alone."""
    whole = effect(path, ABOUT, "table_offset").increments
    rows = effect(path, ABOUT, "off_axis_lever_arm").increments
    jumps, ends = path.jumps[0] + path.jumps[1], path.jumps[1].any(axis=1)
    inside = ~jumps.any(axis=1)
    for i in range(3):
        for n, j in enumerate(OTHERS[i]):
            row = rows[2 * i + n]
            assert not np.delete(row[inside], 3 + i, axis=1).any()
            np.testing.assert_array_equal(row[inside][:, 3 + i], whole[j][inside][:, 3 + i])
            # a jump along the axis, in the attitude of its end of the turn
            for s in np.flatnonzero(~inside):
                w, dt = path.steps.rate[s], path.motion.duration[s]
                jump = np.cross(jumps[s], np.eye(3)[j])[i] * np.eye(3)[i]
                turned = Rotation.from_rotvec(0.5 * dt * w * (1 if ends[s] else -1))
                steady = np.cross(w, np.cross(w, np.eye(3)[j]))[i] * dt * np.eye(3)[i]
                expected = turned.apply(jump) + steady
                np.testing.assert_allclose(row[s, 3:], expected, atol=1e-3 * np.linalg.norm(w))


def test_another_site_is_a_site_elsewhere(path, parts):
    small = 1e-5
    sides = [
        increments(
            path,
            parts,
            gravity=earth.gravity_ned(SITE.latitude + s, SITE.height),
            earth_rate=earth.earth_rate_ned(SITE.latitude + s),
        )
        for s in (small, -small)
    ]
    row = effect(path, ABOUT, "latitude").increments[0]
    np.testing.assert_allclose(row, (sides[0] - sides[1]) / (2 * small), atol=1e-6)
    nominal, g = increments(path, parts), path.gravity
    more = increments(path, parts, gravity=g + np.eye(3)[2])
    np.testing.assert_allclose(
        effect(path, ABOUT, "gravity").increments[0], more - nominal, atol=1e-11
    )
    tilt = 1e-4
    for m in range(2):
        # the plumb line leans: north (or east) of the ellipsoid's normal, seen from below
        leaned = g - g[2] * tilt * np.eye(3)[m]
        change = (increments(path, parts, gravity=leaned) - nominal) / tilt
        np.testing.assert_allclose(
            effect(path, ABOUT, "deflection").increments[m], change, atol=1e-6
        )


def differences(schedule, path, rates, size):
    sides = [increments(path, parts_of(schedule, rates(s))) for s in (size, -size)]
    return (sides[0] - sides[1]) / (2 * size)


def test_turns_by_another_angle_leave_all_that_follows_turned(schedule, path):
    rows = effect(path, ABOUT, "turn_angle").increments
    for n in range(3):

        def rates(s, n=n):
            angle = np.deg2rad((45.0, 90.0, 180.0)[n])
            return lambda turn, rate: rate * (1.0 + (turn == n) * s / angle)

        expected, rest = differences(schedule, path, rates, 1e-4), path.steps.turn < 0
        np.testing.assert_allclose(rows[n][rest], expected[rest], atol=1e-6)
        np.testing.assert_allclose(rows[n], expected, atol=3e-2)


def test_an_axis_that_leans_turns_about_another(schedule, path):
    rows = effect(path, ABOUT, "table_axis").increments
    for i in range(3):
        for n, j in enumerate(OTHERS[i]):

            def rates(s, i=i, j=j):
                return lambda turn, rate: rate + s * rate[i] * np.eye(3)[j]

            expected = differences(schedule, path, rates, 1e-5)
            rest = path.steps.turn < 0
            np.testing.assert_allclose(rows[2 * i + n][rest], expected[rest], atol=1e-6)
            # within a turn the mean lean takes the place of the lean: of second order in a step
            np.testing.assert_allclose(rows[2 * i + n], expected, atol=2e-2)


def test_a_base_that_tilts(path, parts):
    size, g, w = 1e-5, path.gravity, path.earth_rate
    for m in range(2):
        direction = np.eye(3)[m]

        def tilted(t, part, sign, direction=direction):
            psi = sign * size * (t / path.edges[-1] - 0.5) * direction
            attitude = Rotation.from_rotvec(psi).as_matrix() @ part.attitude_at(t)
            turning = attitude.T @ (sign * size / path.edges[-1] * direction)
            return np.concatenate([part.rate_at(t) + turning + attitude.T @ w, attitude.T @ -g])

        sides = [
            walk(SITE, parts, path.edges, lambda t, part, s=s: tilted(t, part, s)) for s in (1, -1)
        ]
        row = effect(path, ABOUT, "base_tilt").increments[m]
        np.testing.assert_allclose(row, (sides[0] - sides[1]) / (2 * size), atol=2e-3)


def test_vibration_shakes_the_base(path, parts):
    rows = effect(path, ABOUT, "vibration").increments
    phase = 2.0 * np.pi * ABOUT.vibration_frequency
    within = np.arange(40) / 40 * path.motion.duration[:, None]
    fine = np.append((path.edges[:-1, None] + within).ravel(), path.edges[-1])
    for n, wave in enumerate((np.cos, np.sin)):
        for m in range(3):

            def shaken(t, part, wave=wave, m=m):
                return part.attitude_at(t).T[:, m] * wave(phase * t)

            whole = walk(SITE, parts, fine, shaken).reshape(-1, 40, 3).sum(axis=1)
            rest = path.steps.turn < 0
            np.testing.assert_allclose(rows[3 * n + m][rest, 3:], whole[rest], atol=1e-9)


@pytest.mark.parametrize("delay", [0.004, -0.004])
def test_a_delay_reads_an_earlier_window(path, parts, delay):
    terms = delay_series(path)
    powers = [max(delay, 0.0) ** n for n in range(1, DELAY_TERMS + 1)]
    powers += [max(-delay, 0.0) ** n for n in range(1, DELAY_TERMS + 1)]
    row = np.tensordot(powers, terms, axes=1)
    longer = [replace(part) for part in parts]
    longer[0].start, longer[-1].end = -1.0, longer[-1].end + 1.0
    both = seen(SITE)
    late = walk(SITE, longer, path.edges - delay, both)[:, 3:]
    change = late - walk(SITE, longer, path.edges, both)[:, 3:]
    jerk = np.abs([part.acceleration for part in parts]).max() * abs(delay) ** 3 / 6.0
    np.testing.assert_allclose(row[:, 3:], change, atol=3e-12 + 1.01 * jerk * path.gravity[2])
    assert not row[:, :3].any()


def test_turns_that_hurry_and_then_dally_end_in_time_and_place(path, parts):
    row = effect(path, ABOUT, "turn_rate").increments[0]
    size, w, g = 1e-5, path.earth_rate, path.gravity
    rests = [p for p in parts if not (p.rate.any() or p.acceleration.any())]
    middles = [0.5 * (a.end + b.start) for a, b in pairwise(rests)]

    def turned(t, part, share):
        n = sum(rest.end <= t for rest in rests)
        attitude, rate = part.attitude_at(t), part.rate_at(t)
        if part not in rests:
            gone = Rotation.from_matrix(rests[n - 1].attitude.T @ attitude).magnitude()
            left = Rotation.from_matrix(attitude.T @ rests[n].attitude).magnitude()
            axis = rate / np.linalg.norm(rate)
            ahead = Rotation.from_rotvec(share * min(gone, left) * axis)
            attitude = attitude @ ahead.as_matrix()
            rate = rate * (1.0 + share * np.sign(middles[n - 1] - t))
        return np.concatenate([rate + attitude.T @ w, attitude.T @ -g])

    edges = np.unique(np.concatenate([path.edges, middles]))
    sides = [
        walk(SITE, parts, edges, lambda t, part, s=s: turned(t, part, s)) for s in (size, -size)
    ]
    first = np.searchsorted(edges, path.edges[:-1] - 1e-9)
    expected = np.add.reduceat((sides[0] - sides[1]) / (2.0 * size), first, axis=0)
    rest = path.steps.turn < 0
    np.testing.assert_allclose(row[rest], expected[rest], atol=1e-8)
    # within a step its mean lead takes the place of the lead, of its peak as well
    np.testing.assert_allclose(row, expected, atol=4e-2)
