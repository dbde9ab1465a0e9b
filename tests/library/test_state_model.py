import numpy as np
import pytest
from conftest import SITES, paper_schedule, paper_truth
from scipy.integrate import quad_vec
from scipy.linalg import expm

from inscal import earth, navigation, parameters
from inscal.motion import Site, attitude_at, build_motion
from inscal.navigation import advance, site_constants
from inscal.rotation import skew
from inscal.schedule import Schedule, Turn, segments
from inscal.sensor import compensate
from inscal.state_model import (
    NAVIGATION,
    NoiseModel,
    StateModel,
    build_transitions,
    navigation_dynamics,
    parameter_dynamics,
)

SITE = Site(np.deg2rad(39.98), 50.0)
NOISE = NoiseModel(1.5e-7, 5e-5, 1e-3, 0.1)
SIZE = paper_truth() * parameters.si_units(1673.84e-9)


def transitions(schedule, noise=NOISE):
    return build_transitions(schedule, SITE, StateModel(), noise, update_interval=1.0)


def navigate(
    motion, believed, attitude_error=(0, 0, 0), velocity=(0, 0, 0), offset=(0, 0, 0), site=SITE
):
    """Nonlinear navigation of error-free data with wrong parameters or a wrong start."""
    rows = 27 + navigation.ROWS
    state = np.zeros((rows, 1))
    state[:27, 0] = believed
    wrong = (np.eye(3) - skew(np.array(attitude_error))) @ motion.initial_attitude
    state[27:36, 0] = wrong.ravel()
    state[36:39, 0] = velocity
    state[39:42, 0] = offset
    for angle, dv, dt in zip(motion.angle, motion.velocity, motion.duration, strict=True):
        step = compensate(state, 0, tuple(angle), tuple(dv), dt)
        advance(state, 27, 0, *step, dt, site_constants(site))
    return state[27:, 0]


def difference(motion, plus, minus, step, true_attitude, site=SITE):
    """Central difference of phi, dV and dp in the filter's definition."""
    a, b = navigate(motion, **plus, site=site), navigate(motion, **minus, site=site)
    turned = (a[:9] - b[:9]).reshape(3, 3) @ true_attitude.T / (2 * step)
    phi = -np.array([turned[2, 1], turned[0, 2], turned[1, 0]])
    velocity, offset = (a[9:12] - b[9:12]) / (2 * step), (a[12:] - b[12:]) / (2 * step)
    return np.concatenate([phi, velocity, offset * site.metres])


def linear(model, x, parameter):
    for index in model.index:
        x = model.navigation @ x + model.parameter[index] @ parameter
    return x


def relative_difference(got, expected, duration):
    """Largest difference per column, each state weighed by the velocity it stands for."""
    weight = np.repeat([9.8 * duration, 1.0, 1.0 / duration], 3)
    weighed = (np.asarray(x).T * weight for x in (got, expected))
    got, expected = weighed
    size = np.abs(expected).max(axis=-1)
    # a gyro scale factor, or a lever arm at Earth rate, may have next to no effect
    return np.abs(got - expected).max(axis=-1) / np.maximum(size, 1e-9)


PATHS = {
    "dwell": (),
    "about x": (Turn(np.pi / 2, 0),),
    "about y": (Turn(-np.pi / 2, 1),),
    "about z": (Turn(np.pi, 2),),
    "all": (Turn(np.pi / 2, 1), Turn(np.pi / 2, 0), Turn(np.pi / 2, 2)),
}


@pytest.mark.parametrize("path", PATHS)
def test_parameter_columns_against_nonlinear_navigation(path):
    schedule = Schedule(("East", "Down", "North"), PATHS[path], 21.0, np.deg2rad(10.0))
    motion = build_motion(schedule, SITE, update_interval=1.0, dwell_step=0.01, turn_step=0.01)
    end = segments(schedule)[-1]
    true_attitude = attitude_at(end, np.array([end.end]))[0]
    model = transitions(schedule)
    columns, expected = np.empty((9, 27)), np.empty((9, 27))
    for i in range(27):
        unit = np.eye(27)[i] * SIZE[i]
        # errors are true minus believed parameters
        columns[:, i] = difference(
            motion, {"believed": -unit}, {"believed": unit}, 1.0, true_attitude
        )
        expected[:, i] = linear(model, np.zeros(NAVIGATION), unit)
    assert relative_difference(columns, expected, schedule.duration).max() < 2e-5


def test_navigation_block_against_nonlinear_navigation():
    schedule = Schedule(("North", "East", "Down"), (), 60.0, 0.2)
    motion = build_motion(schedule, SITE, update_interval=1.0, dwell_step=0.02, turn_step=0.02)
    model = transitions(schedule)
    starts = {
        0: {"attitude_error": (1e-4, 0, 0)},
        1: {"attitude_error": (0, 1e-4, 0)},
        2: {"attitude_error": (0, 0, 1e-4)},
        3: {"velocity": (1e-2, 0, 0)},
        4: {"velocity": (0, 1e-2, 0)},
        5: {"velocity": (0, 0, 1e-2)},
        8: {"offset": (0, 0, 1.0)},
    }
    for state, start in starts.items():
        size = max(np.max(np.abs(v)) for v in start.values())
        key, value = next(iter(start.items()))
        minus = {key: -np.array(value)}
        column = difference(
            motion,
            {"believed": np.zeros(27), **start},
            {"believed": np.zeros(27), **minus},
            size,
            np.eye(3),
        )
        expected = np.linalg.matrix_power(model.navigation, 60)[:, state]
        assert relative_difference(column, expected, 60.0).max() < 2e-5


@pytest.mark.parametrize("interval", [0.1, 10.0])
@pytest.mark.parametrize("place", ["south", "equator", "north pole", "south pole"])
def test_model_elsewhere_against_nonlinear_navigation(place, interval):
    """Every state and parameter at once, by random directions, at other sites and intervals."""
    site = SITES[place]
    turns = (Turn(-np.pi / 4, 2), Turn(1.5 * np.pi, 0), Turn(-np.pi / 2, 1))
    schedule = Schedule(("West", "South", "Up"), turns, 30.0, np.deg2rad(20.0))
    motion = build_motion(schedule, site, update_interval=interval, dwell_step=0.02, turn_step=0.01)
    model = build_transitions(schedule, site, StateModel(), NOISE, update_interval=interval)
    end = segments(schedule)[-1]
    true_attitude = attitude_at(end, np.array([end.end]))[0]
    rng = np.random.default_rng(3)
    # of a size that position adds to gravity and the frame what the others add
    sizes = np.repeat([1e-6, 1e-4, 0.1], 3)
    for _ in range(3):
        x, unit = sizes * rng.uniform(-1, 1, 9), 0.1 * SIZE * rng.uniform(-1, 1, 27)
        plus, minus = (
            {
                "believed": -sign * unit,
                "attitude_error": sign * x[:3],
                "velocity": sign * x[3:6],
                "offset": sign * x[6:] / site.metres,
            }
            for sign in (1, -1)
        )
        found = difference(motion, plus, minus, 1.0, true_attitude, site)
        expected = linear(model, x, unit)
        # near a pole the heading of the frame takes a step's end for its middle
        assert relative_difference(found[:, None], expected[:, None], 120.0).max() < 5e-4


@pytest.mark.parametrize("place", SITES)
def test_rates_of_the_frame_are_those_of_the_ellipsoid(place):
    """Earth rate and transport rate, by what an offset and a velocity do to attitude."""
    site = SITES[place]
    a, step = navigation_dynamics(site), 1e-6
    rates = [earth.earth_rate_ned(site.latitude + s * step) for s in (1, -1)]
    expected = (rates[0] - rates[1]) / (2 * step) / site.metres[0]
    np.testing.assert_allclose(a[0:3, 6], expected, rtol=1e-6, atol=1e-20)
    assert not a[0:3, 7:9].any()
    # a body that goes east turns about the Earth's axis, one that goes north about west
    axis = np.array([np.cos(site.latitude), 0.0, -np.sin(site.latitude)])
    np.testing.assert_allclose(a[0:3, 4], axis / site.metres[1], rtol=1e-9)
    assert a[1, 3] == pytest.approx(-1.0 / site.metres[0])


@pytest.mark.parametrize(
    ("interval", "some"),
    [(1.0, (0, 6, 7, 11, 12, 20, 23, 30)), (4.0, (0, 1, 2, 5, 8)), (12.0, (0, 1))],
)
@pytest.mark.parametrize("acceleration", [None, np.deg2rad(30.0)])
def test_interval_integral_against_adaptive_quadrature(interval, some, acceleration):
    # turns that start and end inside update intervals, at the end in the first of them
    turns = (Turn(np.pi / 2, 1), Turn(np.pi, 0))
    schedule = Schedule(("North", "East", "Down"), turns, 12.0, np.deg2rad(17.0), acceleration)
    model = build_transitions(schedule, SITE, StateModel(), NOISE, update_interval=interval)
    a = navigation_dynamics(SITE)
    parts = segments(schedule)

    def column(t, end):
        part = next(p for p in parts if p.start <= t <= p.end)
        c = attitude_at(part, np.array([t]))[0]
        rate = part.rate + (t - part.start) * part.acceleration
        rate = rate + c.T @ earth.earth_rate_ned(SITE.latitude)
        force = c.T @ -earth.gravity_ned(SITE.latitude, SITE.height)
        return expm(a * (end - t)) @ parameter_dynamics(c, rate, force)

    breaks = [p.start for p in parts]
    for k in some:
        start, last = k * interval, (k + 1) * interval
        inside = [t for t in breaks if start < t < last]
        integral, _ = quad_vec(
            lambda t, last=last: column(t, last), start, last, epsabs=1e-13, points=inside or None
        )
        # ramps begin at no round time, and transitions are shared by times alike to 1e-9 s
        allowed = 1e-9 if acceleration is None else 2e-9
        np.testing.assert_allclose(
            model.parameter[model.index[k]], integral, rtol=allowed, atol=1e-12
        )


@pytest.mark.parametrize("interval", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("place", ["laboratory", "south", "north pole"])
def test_noise_covariance_against_quadrature(place, interval):
    a = navigation_dynamics(SITES[place])
    density = np.diag([NOISE.gyro**2] * 3 + [NOISE.accel**2] * 3 + [0.0] * 3)
    integral, _ = quad_vec(
        lambda t: expm(a * t) @ density @ expm(a * t).T, 0, interval, epsabs=1e-25
    )
    schedule = paper_schedule(2, position_duration=20.0)
    got = build_transitions(
        schedule, SITES[place], StateModel(), NOISE, update_interval=interval
    ).noise
    scale = np.sqrt(np.outer(np.diag(integral), np.diag(integral)))
    np.testing.assert_allclose(got / scale, integral / scale, atol=1e-9)


def test_state_models_are_lists_of_groups():
    assert StateModel().states == 36
    classic = StateModel(("gyro_bias", "accel_bias", "gyro_k", "accel_k"))
    assert classic.states == 30
    with_arm = StateModel((*classic.groups, "lever_arm"))
    assert with_arm.states == 33
    assert [parameters.NAMES[i] for i in with_arm.columns[-3:]] == [f"lever_arm_{a}" for a in "xyz"]
    # state order does not follow the order of the list
    assert StateModel(classic.groups[::-1]).columns.tolist() == classic.columns.tolist()
