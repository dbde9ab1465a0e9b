"""Augmented filters: against the joint posterior, against whole campaigns, and each part alone."""

import dataclasses
from functools import cache

import numpy as np
import pytest
from conftest import paper_schedule
from disturbed_case import NOISE, SCHEDULE, SITE, SIZE, STD, STEPS
from scipy import stats

from inscal import parameters
from inscal.augmentation import augment
from inscal.disturbance import Disturbance
from inscal.estimator import CONSTANTS, Belief, build_estimator, initial_constants
from inscal.experiment import prepare, run
from inscal.path import path_of
from inscal.recursion import ATTITUDE
from inscal.simulation import Truth, TruthModel
from inscal.state_model import NAVIGATION, StateModel, build_transitions

BASE = tuple(parameters.GROUPS)
BELIEVED = Disturbance(
    **{"off_axis_lever_arm": 0.02, "table_offset": 0.02, "gyro_accel_delay": 1e-3},
    **{"accel_wander": 2e-5, "accel_wander_time": 300.0, "accel_drift": 1e-4},
    **{"gyro_wander": 3e-9, "gyro_wander_time": 200.0, "accel_cubic": 1e-7},
)
SHORT = paper_schedule(4, position_duration=24.0)


def model_of(*groups):
    return StateModel((*groups, *BASE))


@cache
def short_path():
    return path_of(SHORT, SITE, update_interval=1.0, dwell_step=1.0, turn_step=0.5)


def filtered(model, noise=NOISE):
    """Estimator of a short path, and its transitions."""
    augmented = augment(model, BELIEVED, short_path(), 1.0)
    belief = Belief(noise, STD, 2, 1.0, model, BELIEVED)
    transitions = build_transitions(SHORT, SITE, model, noise, update_interval=1.0)
    transitions = dataclasses.replace(transitions, augmented=augmented.transitions)
    return build_estimator(SHORT, SITE, belief, augmented), transitions


def unknowns(transitions, model):
    """Everything unknown at unit size: names of blocks, and how many."""
    about, updates = transitions.augmented, len(transitions.index)
    return {
        "constant": CONSTANTS + about.constants,
        "moving": 6,  # velocity and position at the start
        "wandering": about.wandering,
        "u": updates * about.wandering,
        "v": updates * about.wandering,
        "noise": updates * NAVIGATION,
    }


def observed(transitions, model, noise):
    """What each unknown of unit size does to all observations of unit noise, one by one.

    By the definition of the model, state by state, without covariances, roots or gains.
    """
    about, updates = transitions.augmented, len(transitions.index)
    counts = unknowns(transitions, model)
    first = dict(zip(counts, np.cumsum([0, *counts.values()][:-1]), strict=True))
    total, c, w = sum(counts.values()), about.constants, about.wandering
    constants = np.zeros((CONSTANTS + c, total))
    spread = initial_constants(transitions, STD)
    constants[range(len(spread)), range(len(spread))] = spread
    wandering = np.zeros((w, total))
    wandering[range(w), first["wandering"] + np.arange(w)] = about.std[c:]
    nav = np.zeros((NAVIGATION, total))
    nav[:3] = constants[27:30]
    moving = np.repeat([STD.velocity, STD.position], 3)
    nav[range(3, 9), first["moving"] + np.arange(6)] = moving
    root = np.linalg.cholesky(transitions.noise + 1e-40 * np.eye(9))
    out = []
    for k, index in enumerate(transitions.index):
        of_aug, place = about.navigation[k], k * w + np.arange(w)
        nav = transitions.navigation @ nav + transitions.parameter[index] @ constants[:27]
        nav += of_aug[:, :c] @ constants[CONSTANTS:] + of_aug[:, c:] @ wandering
        for n, unit in enumerate("uv"):
            nav[:, first[unit] + place] += of_aug[:, c:] * about.driven[:, n]
        nav[:, first["noise"] + NAVIGATION * k + np.arange(NAVIGATION)] += root
        wandering = about.decay[:, None] * wandering
        wandering[range(w), first["u"] + place] += about.drive
        out.append(nav[3:9] / np.repeat([noise.velocity, noise.position], 3)[:, None])
    assert updates == len(out)
    return np.concatenate(out), spread


TRIED = [
    ("off_axis_lever_arm", "accel_wander"),
    ("accel_wander", "gyro_wander"),
    ("gyro_accel_delay", "accel_drift", "table_offset"),
    ("accel_cubic",),
]


@pytest.mark.parametrize("groups", TRIED)
def test_covariance_is_that_of_the_joint_posterior(groups):
    model = model_of(*groups)
    estimator, transitions = filtered(model)
    matrix, spread = observed(transitions, model, NOISE)
    posterior = np.linalg.inv(matrix.T @ matrix + np.eye(matrix.shape[1]))
    own = slice(0, len(spread))
    expected = spread[:, None] * posterior[own, own] * spread
    sigma = np.sqrt(np.diag(expected))
    found = estimator.first.covariance / np.outer(sigma, sigma)
    np.testing.assert_allclose(found, expected / np.outer(sigma, sigma), atol=2e-6)
    assert (sigma < 0.5 * spread).any()


@pytest.mark.parametrize("groups", TRIED[:3])
def test_passes_are_exact_on_a_linear_record(groups):
    """First pass, and a further one from anywhere: both are the joint posterior's mean."""
    loud = dataclasses.replace(NOISE, velocity=0.03, position=1.0)
    model = model_of(*groups)
    estimator, transitions = filtered(model, loud)
    matrix, spread = observed(transitions, model, loud)
    rng = np.random.default_rng(5)
    record = matrix @ rng.standard_normal(matrix.shape[1]) + rng.standard_normal(len(matrix))
    mean = np.linalg.solve(matrix.T @ matrix + np.eye(matrix.shape[1]), matrix.T @ record)
    expected = spread * mean[: len(spread)]
    scale = np.repeat([loud.velocity, loud.position], 3)
    record = record.reshape(-1, 6) * scale
    sigma = np.sqrt(np.diag(estimator.first.covariance))
    first = linear_pass(estimator.first, transitions, np.zeros(len(spread)), record)
    np.testing.assert_allclose(first / sigma, expected / sigma, atol=1e-5)
    start = spread * rng.standard_normal(len(spread))
    seen = record - (matrix[:, : len(spread)] @ (start / spread)).reshape(-1, 6) * scale
    tight = linear_pass(estimator.later, transitions, start, seen)
    second = start + estimator.translate @ (tight - start) - estimator.pull @ start
    np.testing.assert_allclose(second / sigma, expected / sigma, atol=2e-5)
    assert np.abs((tight - expected) / sigma).max() > 0.1


def linear_pass(gains, transitions, start, observations):
    """What a pass makes of a linear record, seen from an assumed `start` of the constants."""
    about = transitions.augmented
    base, fixed = NAVIGATION + parameters.COUNT, NAVIGATION + CONSTANTS
    x = np.zeros(fixed + len(about.std))
    for k, index in enumerate(transitions.index):
        x[:9] = transitions.navigation @ x[:9] + transitions.parameter[index] @ x[9:base]
        x[:9] += about.navigation[k] @ x[fixed:]
        x[len(x) - about.wandering :] *= about.decay
        x = x + gains.gain[k] @ (observations[k] - x[3:9])
    return start + x[NAVIGATION : fixed + about.constants]


def test_a_bias_that_wanders_acts_as_a_bias_does():
    """Columns from steps against those that quadrature has made of the constant ones."""
    _, transitions = filtered(model_of("accel_wander", "gyro_wander"))
    about = transitions.augmented
    x = 1.0 / np.array([BELIEVED.gyro_wander_time, BELIEVED.accel_wander_time])
    held = -np.expm1(-x) / x  # of a bias that decays for a second, on average
    constant = transitions.parameter[transitions.index][:, :, :6]
    expected = constant * np.repeat(held, 3)
    difference = np.abs(about.navigation - expected).max(axis=(1, 2)) / np.abs(expected).max()
    rests = short_path().steps.turn < 0
    at_rest = np.logical_and.reduceat(rests, short_path().steps.update_step[:-1])
    assert difference[at_rest].max() < 1e-9
    # in turns an increment is taken to come along the chord of its step's 5 degrees
    assert 1e-5 < difference[~at_rest].max() < 0.01
    np.testing.assert_allclose(about.decay, np.repeat(np.exp(-x), 3), rtol=1e-12)


CAMPAIGNS = {
    "arms and delay": (("off_axis_lever_arm", "gyro_accel_delay"), set()),
    "offset and cubic": (("table_offset", "accel_cubic"), set()),
    "wander": (("accel_wander", "gyro_wander"), {"gyro_wander_time", "accel_wander_time"}),
}


@cache
def campaign(name, modelled=True, runs=512):
    groups, times = CAMPAIGNS[name]
    kept = {parameters.AUGMENTATIONS[g].source for g in groups} | times
    sizes = {k: v for k, v in dataclasses.asdict(BELIEVED).items() if k in kept}
    experiment = prepare(
        3,
        SCHEDULE,
        SITE,
        Truth(TruthModel("normal", 0.1 * SIZE), NOISE, STD, Disturbance(**sizes)),
        Belief(NOISE, STD, 2, 1.0, model_of(*groups) if modelled else StateModel(), BELIEVED),
        dwell_step=STEPS["dwell_step"],
        turn_step=STEPS["turn_step"],
    )
    return experiment, run(experiment, range(runs))


@pytest.mark.parametrize("name", CAMPAIGNS)
def test_what_is_modelled_does_no_harm(name):
    """Disturbances from far out are estimated with an honest sigma, and so are the parameters."""
    experiment, outcome = campaign(name)
    _, without = campaign(name, modelled=False, runs=32)
    runs = len(outcome.nees)
    assert without.nees.mean() > 100.0
    assert not outcome.failed.any()
    low, high = stats.chi2.ppf([5e-5, 1 - 5e-5], 27 * runs) / runs
    assert low < outcome.nees.mean() < high
    estimator = experiment.estimator
    error = outcome.augmented_estimate - outcome.augmented_truth
    assert error.shape == (runs, len(estimator.augmented_names))
    ratio = np.sqrt(np.square(error).mean(axis=0)) / estimator.augmented_std
    assert (np.abs(ratio - 1.0) < 5.0 / np.sqrt(2 * runs)).all()


def test_in_ramps_too_what_is_modelled_does_no_harm():
    """Arms and a delay act most where the rate changes: runs of a path whose turns have ramps."""
    ramped = dataclasses.replace(SCHEDULE, turn_acceleration=np.deg2rad(10.0))
    sizes = {"off_axis_lever_arm": 0.02, "gyro_accel_delay": 1e-3, "table_offset": 0.02}
    groups = tuple(sizes)
    experiment = prepare(
        3,
        ramped,
        SITE,
        Truth(TruthModel("normal", 0.1 * SIZE), NOISE, STD, Disturbance(**sizes)),
        Belief(NOISE, STD, 2, 1.0, model_of(*groups), BELIEVED),
        dwell_step=1.0,
        turn_step=0.5,
    )
    outcome = run(experiment, range(64))
    low, high = stats.chi2.ppf([5e-5, 1 - 5e-5], 27 * 64) / 64
    assert low < outcome.nees.mean() < high


def test_runs_do_not_depend_on_their_company():
    experiment, outcome = campaign("wander")
    alone = run(experiment, [37])
    assert (alone.estimate == outcome.estimate[37:38]).all()
    experiment, outcome = campaign("offset and cubic")
    alone = run(experiment, [37])
    for name in ("estimate", "augmented_estimate", "augmented_truth", "nees"):
        assert (getattr(alone, name) == getattr(outcome, name)[37:38]).all()


def test_states_have_names_in_one_order_whatever_is_asked_for():
    model = model_of("accel_wander", "off_axis_lever_arm")
    assert model.augmented[:3] == ("lever_arm_xy", "lever_arm_xz", "lever_arm_yx")
    assert model.augmented[-3:] == ("accel_wander_x", "accel_wander_y", "accel_wander_z")
    assert model.states == 36 + 9
    assert StateModel((*BASE, *parameters.AUGMENTATIONS)).states == 36 + 62
    names = [*parameters.NAMES, *StateModel(tuple(parameters.AUGMENTATIONS)).augmented]
    assert len(set(names)) == len(names)
    assert [g.wanders for g in parameters.AUGMENTATIONS.values()][-2:] == [True, True]


def test_a_state_without_a_prior_is_refused():
    with pytest.raises(ValueError, match="gravity needs a prior above zero"):
        augment(model_of("gravity"), BELIEVED, short_path(), 1.0)
    belief = Belief(NOISE, STD, 2, 1.0, model_of("table_offset"), BELIEVED)
    with pytest.raises(ValueError, match="are not prepared"):
        build_estimator(SHORT, SITE, belief)
    assert augment(StateModel(), BELIEVED, short_path(), 1.0) is None
    assert ATTITUDE == 3
