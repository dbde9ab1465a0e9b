import dataclasses

import numpy as np
import pytest
from conftest import SITES, paper_schedule, paper_truth

from inscal import parameters
from inscal.information import parameter_information
from inscal.motion import Site
from inscal.recursion import InitialStd, compute_gains
from inscal.state_model import NAVIGATION, NoiseModel, StateModel, Transitions, build_transitions

SITE = Site(np.deg2rad(39.98), 50.0)
NOISE = NoiseModel(1.5e-7, 5e-5, 1e-3, 0.1)
SIZE = paper_truth() * parameters.si_units(1673.84e-9)
STD = InitialStd(np.deg2rad([0.1, 0.1, 0.5]), 0.01, 1.0, SIZE)
FULL = StateModel()
CLASSIC = StateModel(("gyro_bias", "accel_bias", "gyro_k", "accel_k"))


def transitions_of(positions, duration, model=FULL, noise=NOISE):
    schedule = paper_schedule(positions, position_duration=duration)
    return build_transitions(schedule, SITE, model, noise, update_interval=1.0)


def information_matrix(result):
    return result.root.T @ result.root


def scaled_difference(a, b):
    sigma = np.sqrt(np.diag(b))
    used = sigma > 0
    assert (a[~used] == 0).all()
    assert used.any()
    return (np.abs(a - b)[np.ix_(used, used)] / np.outer(sigma[used], sigma[used])).max()


@pytest.mark.parametrize(
    ("positions", "duration", "model", "tolerance"),
    [
        (1, 30.0, FULL, 1e-9),
        (3, 20.0, FULL, 1e-9),
        (5, 300.0, CLASSIC, 1e-8),
        (25, 500.0, FULL, 1e-8),
    ],
)
def test_against_the_covariance_recursion(positions, duration, model, tolerance):
    transitions = transitions_of(positions, duration, model)
    bound = parameter_information(transitions, model, NOISE, STD).bayesian_covariance(SIZE)
    expected = compute_gains(transitions, model, NOISE, STD).covariance
    count = parameters.COUNT
    assert scaled_difference(bound, expected[:count, :count]) < tolerance


@pytest.mark.parametrize("interval", [0.1, 10.0])
@pytest.mark.parametrize("place", ["south", "north pole"])
def test_against_the_covariance_recursion_elsewhere(place, interval):
    schedule = paper_schedule(6, position_duration=50.0)
    transitions = build_transitions(schedule, SITES[place], FULL, NOISE, update_interval=interval)
    bound = parameter_information(transitions, FULL, NOISE, STD).bayesian_covariance(SIZE)
    expected = compute_gains(transitions, FULL, NOISE, STD).covariance
    assert scaled_difference(bound, expected[:27, :27]) < 1e-8


def test_against_the_joint_gaussian_of_all_states():
    """Brute force: parameters, initial state and all noise of a tiny problem as one least squares.

    Columns of what is not asked for come first, so that the last rows of the triangle are what is
    left for the parameters once all of it is eliminated.
    """
    transitions = transitions_of(3, 20.0)
    updates, count, nav = len(transitions.index), parameters.COUNT, NAVIGATION
    nuisance = nav + nav * updates
    state = np.zeros((nav, nuisance + count))
    state[:, :nav] = np.diag(np.repeat([1.0, STD.velocity, STD.position], 3))
    state[:3, :3] = np.diag(STD.attitude)
    noise_root = np.linalg.cholesky(transitions.noise)
    rows = []
    for k, index in enumerate(transitions.index):
        state = transitions.navigation @ state
        state[:, nuisance:] += transitions.parameter[index] * SIZE
        state[:, nav * (k + 1) : nav * (k + 2)] += noise_root
        rows.append(state[3:9] / np.repeat([NOISE.velocity, NOISE.position], 3)[:, None])
    known = np.eye(nuisance, nuisance + count)  # unit variance of all but the parameters
    root = np.linalg.qr(np.concatenate([known, *rows]), mode="r")[nuisance:, nuisance:]
    expected = root.T @ root
    found = information_matrix(parameter_information(transitions, FULL, NOISE, STD))
    np.testing.assert_allclose(found, expected, atol=1e-8 * np.abs(expected).max())
    posterior = np.linalg.inv(expected + np.eye(count)) * np.outer(SIZE, SIZE)
    bound = parameter_information(transitions, FULL, NOISE, STD).bayesian_covariance(SIZE)
    assert scaled_difference(bound, posterior) < 1e-7


def ramp(updates, gyro_noise=0.0):
    """Navigation that stands still but for one parameter per axis that drives the velocity."""
    parameter = np.zeros((1, NAVIGATION, 3))
    parameter[0, 3:6] = np.diag([1.0, 2.0, 3.0])
    noise = np.zeros((NAVIGATION, NAVIGATION))
    noise[3:6, 3:6] = gyro_noise**2 * np.eye(3)
    still = np.zeros((NAVIGATION, NAVIGATION))
    index = np.zeros(updates, int)
    return Transitions(np.eye(NAVIGATION), parameter, index, noise, still, 1.0)


def test_straight_line_in_closed_form():
    # observed velocity v0 + k s b + noise: regression on a line whose intercept has a prior
    updates, model = 40, StateModel(("gyro_bias",))
    result = parameter_information(ramp(updates), model, NOISE, STD)
    k = np.arange(1, updates + 1)
    intercept = updates / NOISE.velocity**2 + 1 / STD.velocity**2
    slope = (k**2).sum() / NOISE.velocity**2 - (k.sum() / NOISE.velocity**2) ** 2 / intercept
    information = slope * np.array([1.0, 2.0, 3.0]) ** 2
    np.testing.assert_allclose(result.classical_std()[:3], information**-0.5, rtol=1e-10)
    assert (result.classical_std()[3:] == 0).all()
    prior = np.full(parameters.COUNT, 2e-5)
    variance = np.diag(result.bayesian_covariance(prior))[:3]
    np.testing.assert_allclose(variance, 1 / (information + 2e-5**-2), rtol=1e-10)


def test_random_walk_in_closed_form():
    # with perfect observations the increments b s + w are independent, and the first one also
    # carries the unknown start
    updates, walk, sharp = 40, 3e-3, NoiseModel(0.0, 0.0, 1e-9, 0.1)
    result = parameter_information(ramp(updates, walk), StateModel(("gyro_bias",)), sharp, STD)
    information = (updates - 1) / walk**2 + 1 / (walk**2 + STD.velocity**2)
    expected = information**-0.5 / np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(result.classical_std()[:3], expected, rtol=1e-6)


@pytest.mark.parametrize("louder", ["gyro", "accel", "velocity", "position"])
def test_more_noise_never_informs(louder):
    noise = dataclasses.replace(NOISE, **{louder: 3 * getattr(NOISE, louder)})
    quiet, loud = (
        information_matrix(parameter_information(transitions_of(4, 100.0, noise=n), FULL, n, STD))
        for n in (NOISE, noise)
    )
    size = np.abs(quiet).max()
    assert np.linalg.eigvalsh(quiet - loud).min() > -1e-9 * size
    assert np.linalg.eigvalsh(quiet - loud).max() > 1e-3 * size


def test_a_longer_record_never_informs_less():
    whole = transitions_of(4, 100.0)
    head = dataclasses.replace(whole, index=whole.index[:250])
    short, long = (
        information_matrix(parameter_information(t, FULL, NOISE, STD)) for t in (head, whole)
    )
    assert np.linalg.eigvalsh(long - short).min() > -1e-9 * np.abs(long).max()
    assert np.linalg.eigvalsh(long - short).max() > 1e-3 * np.abs(long).max()


def test_one_position_does_not_determine_the_parameters():
    result = parameter_information(transitions_of(1, 60.0), FULL, NOISE, STD)
    assert np.isinf(result.classical_std()).any()
    assert np.isfinite(result.bayesian_covariance(SIZE)).all()


def test_the_full_path_does_and_the_prior_only_helps():
    result = parameter_information(transitions_of(25, 100.0), FULL, NOISE, STD)
    classical = result.classical_std()
    assert np.isfinite(classical).all()
    bayesian, wide = (
        np.sqrt(np.diag(result.bayesian_covariance(scale * SIZE))) for scale in (1.0, 1e3)
    )
    assert (bayesian < classical).all()
    np.testing.assert_allclose(wide, classical, rtol=1e-6)
    known = np.where(np.arange(parameters.COUNT) == 0, 0.0, SIZE)  # the first known beforehand
    covariance = result.bayesian_covariance(known)
    assert (covariance[0] == 0).all()
    assert (np.diag(covariance)[1:] <= bayesian[1:] ** 2 * (1 + 1e-12)).all()
