import dataclasses

import numpy as np
import pytest
from conftest import paper_schedule, paper_truth

from inscal import parameters
from inscal.motion import Site
from inscal.recursion import ATTITUDE, InitialStd, compute_gains, square_root
from inscal.state_model import NAVIGATION, NoiseModel, StateModel, build_transitions

SITE = Site(np.deg2rad(39.98), 50.0)
NOISE = NoiseModel(1.5e-7, 5e-5, 1e-3, 0.1)
SIZE = paper_truth() * parameters.si_units(1673.84e-9)
STD = InitialStd(np.deg2rad([0.1, 0.1, 0.5]), 0.01, 1.0, SIZE)
MODELS = {
    36: StateModel(),
    30: StateModel(("gyro_bias", "accel_bias", "gyro_k", "accel_k")),
}
H = np.zeros((6, NAVIGATION))
H[:, 3:9] = np.eye(6)
R = np.diag([1e-6] * 3 + [1e-2] * 3)


def build(positions, duration, model):
    schedule = paper_schedule(positions, position_duration=duration)
    transitions = build_transitions(schedule, SITE, model, NOISE, update_interval=1.0)
    return transitions, compute_gains(transitions, model, NOISE, STD)


def initial_covariance(model, std=STD):
    """Of navigation states, modelled parameters and the appended attitude error at the start."""
    sigma = np.concatenate([std.navigation, std.parameter[model.columns], std.attitude])
    covariance = np.diag(sigma**2)
    covariance[:3, -3:] = covariance[-3:, :3] = np.diag(std.attitude**2)
    return covariance


def scaled_difference(a, b):
    sigma = np.sqrt(np.diag(b))
    return (
        np.abs(a - b).max() if not sigma.all() else (np.abs(a - b) / np.outer(sigma, sigma)).max()
    )


@pytest.mark.parametrize("states", MODELS)
def test_against_the_textbook_filter_in_joseph_form(states):
    model = MODELS[states]
    transitions, gains = build(5, 300.0, model)
    n = model.states + ATTITUDE
    # more digits than double precision has: the textbook's form loses some to rounding
    p = initial_covariance(model).astype(np.longdouble)
    f, h, q = (
        np.asarray(x, np.longdouble) for x in (np.eye(n), np.zeros((6, n)), np.zeros((n, n)))
    )
    f[:NAVIGATION, :NAVIGATION] = transitions.navigation
    h[:, :NAVIGATION] = H
    q[:NAVIGATION, :NAVIGATION] = transitions.noise
    rows = np.concatenate(
        [np.arange(9), 9 + model.columns, 9 + parameters.COUNT + np.arange(ATTITUDE)]
    )
    for k, index in enumerate(transitions.index):
        f[:NAVIGATION, NAVIGATION : model.states] = transitions.parameter[index]
        p = f @ p @ f.T + q
        s = h @ p @ h.T + R
        gain = np.linalg.solve(s.astype(float), (h @ p).astype(float)).T
        keep = np.eye(n) - gain @ h
        p = keep @ p @ keep.T + gain @ R @ gain.T
        assert np.abs(gains.innovation_covariance[k] - s).max() < 1e-9 * np.abs(s).max()
        scale = np.sqrt(np.outer(np.diag(p), 1 / np.diag(R))) + 1e-300
        assert (np.abs(gains.gain[k, rows] - gain) / scale).max() < 1e-9
    inside = np.ix_(rows[9:] - 9, rows[9:] - 9)
    assert scaled_difference(gains.covariance[inside], p[9:, 9:]) < 1e-9
    std = np.sqrt(np.diag(p)[9 : model.states]).astype(float)
    np.testing.assert_allclose(gains.parameter_std[-1, model.columns], std, rtol=1e-9)


@pytest.mark.parametrize("rank", [3, 6])
def test_square_root_of_mixed_units_and_any_rank(rank):
    rng = np.random.default_rng(7)
    size = np.array([1e-12, 1e-9, 1e-3, 1.0, 1e4, 1e7])
    root = size[:, None] * rng.standard_normal((6, rank))
    covariance = root @ root.T
    found = square_root(covariance)
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    np.testing.assert_allclose(found @ found.T / scale, covariance / scale, atol=1e-14)
    still = np.zeros((6, 6))
    still[2:4, 2:4] = [[4.0, 1.0], [1.0, 9.0]]  # what no noise enters
    np.testing.assert_allclose(square_root(still) @ square_root(still).T, still, atol=1e-15)


def test_against_the_joint_posterior_of_all_states():
    """Brute force: every state and all noise of a tiny problem as one Gaussian vector."""
    model = StateModel()
    transitions, gains = build(3, 20.0, model)
    updates, n = len(transitions.index), model.states
    # unknowns: initial state, then the noise of every interval, each with unit variance
    prior = np.sqrt(np.diag(initial_covariance(model))[:n])
    root = np.linalg.cholesky(transitions.noise + 1e-30 * np.eye(9))
    size = n + 9 * updates
    state = np.zeros((n, size))
    state[:, :n] = np.diag(prior)
    rows = []
    for k, index in enumerate(transitions.index):
        state[:NAVIGATION] = (
            transitions.navigation @ state[:NAVIGATION]
            + transitions.parameter[index] @ state[NAVIGATION:]
        )
        state[:NAVIGATION, n + 9 * k : n + 9 * (k + 1)] += root
        rows.append(state[3:9].copy())
    design = np.concatenate(rows) / np.tile(np.sqrt(np.diag(R)), updates)[:, None]
    # of the unit-variance unknowns: posterior by QR, free of the normal equations' squaring
    stacked = np.concatenate([np.eye(size), design])
    inverse_root = np.linalg.inv(np.linalg.qr(stacked, mode="r"))
    parameters_root = state[NAVIGATION:] @ inverse_root
    attitude_root = np.diag(prior)[:3] @ inverse_root[:n]
    both = np.concatenate([parameters_root, attitude_root])
    assert scaled_difference(gains.covariance, both @ both.T) < 1e-6

    # and the estimates: gains applied one by one to a record against least squares on all of it
    rng = np.random.default_rng(3)
    z = design @ rng.standard_normal(size) + rng.standard_normal(6 * updates)
    r, rhs = np.linalg.qr(stacked)
    solution = np.linalg.solve(rhs, r.T @ np.concatenate([np.zeros(size), z]))
    x = np.zeros(n + ATTITUDE)
    observations = (z * np.tile(np.sqrt(np.diag(R)), updates)).reshape(updates, 6)
    for k, index in enumerate(transitions.index):
        x[:9] = transitions.navigation @ x[:9] + transitions.parameter[index] @ x[9:n]
        x = x + gains.gain[k] @ (observations[k] - x[3:9])
    sigma = np.sqrt(np.diag(gains.covariance))
    expected = np.concatenate([(state @ solution)[NAVIGATION:], prior[:3] * solution[:3]])
    np.testing.assert_allclose(x[9:] / sigma, expected / sigma, atol=1e-5)


def test_more_noise_never_sharpens_and_more_data_never_blurs():
    transitions, quiet = build(4, 100.0, StateModel())
    assert (np.diff(quiet.parameter_std, axis=0) <= 1e-12 * SIZE).all()
    louder = NoiseModel(NOISE.gyro, NOISE.accel, 2 * NOISE.velocity, 2 * NOISE.position)
    loud = compute_gains(transitions, StateModel(), louder, STD)
    assert (loud.parameter_std >= quiet.parameter_std * (1 - 1e-12)).all()
    assert (loud.parameter_std[-1] > 1.1 * quiet.parameter_std[-1]).any()


def extended_recursion(transitions, noise, std):
    """Gains and final covariance of all parameters by 80-bit numbers."""
    wide = np.longdouble
    p = initial_covariance(StateModel(), std).astype(wide)
    f, q = transitions.navigation.astype(wide), transitions.noise.astype(wide)
    r = np.repeat([noise.velocity, noise.position], 3).astype(wide) ** 2
    gains = []
    for index in transitions.index:
        rows = f @ p[:9] + transitions.parameter[index].astype(wide) @ p[9:36]
        p[:9, 9:], p[9:, :9] = rows[:, 9:], rows[:, 9:].T
        p[:9, :9] = rows[:, :9] @ f.T + rows[:, 9:36] @ transitions.parameter[index].T + q
        gain = np.zeros((39, 6), dtype=wide)
        for i in range(6):  # one by one: a row of gain in terms of the innovations of all six
            k = p[:, 3 + i] / (p[3 + i, 3 + i] + r[i])
            p = p - np.outer(k, p[3 + i])
            p = (p + p.T) / 2
            before = gain[3 + i].copy()
            gain -= np.outer(k, before)
            gain[:, i] += k
        gains.append(gain)
    return np.array(gains), p[9:, 9:]


@pytest.mark.skipif(np.finfo(np.longdouble).nmant < 63, reason="no 80-bit numbers here")
@pytest.mark.parametrize(
    ("sensors", "observations", "prior"),
    [(1, 1, 1), (1e-3, 1e-3, 1), (0, 1, 1), (1e-3, 1e-3, 10), (1, 1, 100), (1e3, 1e3, 0.01)],
)
def test_against_extended_precision_where_double_precision_is_short(sensors, observations, prior):
    noise = NoiseModel(
        sensors * NOISE.gyro,
        sensors * NOISE.accel,
        observations * NOISE.velocity,
        observations * NOISE.position,
    )
    std = dataclasses.replace(STD, parameter=prior * SIZE)
    schedule = paper_schedule(position_duration=30.0)
    transitions = build_transitions(schedule, SITE, StateModel(), noise, update_interval=1.0)
    expected, covariance = extended_recursion(transitions, noise, std)
    gains = compute_gains(transitions, StateModel(), noise, std)
    r = np.repeat([noise.velocity, noise.position], 3)
    scale = gains.parameter_std[:, :, None] / r
    # 80-bit numbers themselves are right to some 1e-5 at the widest priors tried
    assert (np.abs(gains.gain - expected)[:, 9:36] / scale).max() < 3e-5
    assert scaled_difference(gains.covariance, covariance.astype(float)) < 3e-5


def test_roots_and_what_they_are_roots_of():
    _, gains = build(5, 60.0, StateModel())
    np.testing.assert_allclose(gains.root @ gains.root.T, gains.covariance)
    assert not np.triu(gains.root, 1).any()
    unit = gains.whitening @ gains.innovation_covariance @ gains.whitening.mT
    np.testing.assert_allclose(unit, np.broadcast_to(np.eye(6), unit.shape), atol=1e-12)
    assert not np.triu(gains.whitening, 1).any()
