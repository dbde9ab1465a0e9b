import dataclasses

import numpy as np
from conftest import paper_schedule, paper_truth

from inscal import parameters
from inscal.estimator import CONSTANTS, Belief, build_estimator
from inscal.motion import Site
from inscal.recursion import InitialStd, compute_gains
from inscal.state_model import NAVIGATION, NoiseModel, StateModel, build_transitions

SITE = Site(np.deg2rad(39.98), 50.0)
NOISE = NoiseModel(1.5e-7, 5e-5, 1e-3, 0.1)
SIZE = paper_truth() * parameters.si_units(1673.84e-9)
STD = InitialStd(np.deg2rad([0.1, 0.1, 0.5]), 0.01, 1.0, SIZE)


def build(schedule, model=None, noise=NOISE, passes=2):
    belief = Belief(noise, STD, passes=passes, update_interval=1.0, model=model or StateModel())
    return build_estimator(schedule, SITE, belief)


def linear_pass(gains, transitions, start, observations):
    """What a pass does to a linear system, started from an assumed `start` of the constants."""
    n = NAVIGATION + parameters.COUNT
    x = np.zeros(n + 3)
    # the record seen from the start: errors of the constants are relative to it
    for k, index in enumerate(transitions.index):
        x[:9] = transitions.navigation @ x[:9] + transitions.parameter[index] @ x[9:n]
        x = x + gains.gain[k] @ (observations[k] - x[3:9])
    return start + x[9:]


def observe(transitions, constants):
    """Noise-free observations of a linear system."""
    x = np.concatenate([constants[27:], np.zeros(6)])
    out = []
    for index in transitions.index:
        x = transitions.navigation @ x + transitions.parameter[index] @ constants[:27]
        out.append(x[3:9].copy())
    return np.array(out)


def test_tight_pass_translates_into_the_priors_answer():
    """On a linear system a further pass from anywhere must return the first pass's result."""
    # a path too short to see everything: several parameters keep most of their prior
    schedule = paper_schedule(4, position_duration=60.0)
    loud = dataclasses.replace(NOISE, velocity=0.03, position=1.0)
    model = StateModel()
    estimator = build(schedule, noise=loud)
    transitions = build_transitions(schedule, SITE, model, loud, update_interval=1.0)
    prior = np.concatenate([STD.parameter, STD.attitude])
    rng = np.random.default_rng(11)
    noise = rng.standard_normal((len(transitions.index), 6)) * np.repeat([0.03, 1.0], 3)
    record = observe(transitions, prior * rng.standard_normal(CONSTANTS)) + noise
    first = linear_pass(estimator.first, transitions, np.zeros(CONSTANTS), record)
    for start in (first, prior * rng.standard_normal(CONSTANTS)):
        seen = record - observe(transitions, start)
        tight = linear_pass(estimator.later, transitions, start, seen)
        second = start + estimator.translate @ (tight - start) - estimator.pull @ start
        sigma = np.sqrt(np.diag(estimator.first.covariance))
        np.testing.assert_allclose(second / sigma, first / sigma, atol=2e-5)
        # without the translation it would count the data twice
        assert np.abs((tight - first) / sigma).max() > 0.1


def test_further_pass_starts_with_a_tight_but_never_wider_covariance():
    estimator = build(paper_schedule(4, position_duration=60.0))
    prior = STD.parameter
    first_update = estimator.later.parameter_std[0]
    assert (first_update <= prior * (1 + 1e-12)).all()
    final = estimator.predicted_std
    seen = final < 0.1 * prior
    assert seen.any()
    assert (first_update[seen] < 3.1 * final[seen]).all()


def test_smaller_models_leave_the_other_parameters_alone():
    model = StateModel(("gyro_bias", "accel_bias", "gyro_k", "accel_k"))
    estimator = build(paper_schedule(3, position_duration=60.0), model)
    index = parameters.INDEX
    for group in ("accel_quadratic", "lever_arm"):
        assert (estimator.predicted_std[index[group]] == 0).all()
        for number in (0, 1):
            rows = NAVIGATION + np.arange(27)[index[group]]
            assert (estimator.gains(number).gain[:, rows] == 0).all()
        assert (estimator.translate[index[group]] == np.eye(CONSTANTS)[index[group]]).all()
    assert (estimator.predicted_std[index["gyro_bias"]] > 0).all()


def test_one_pass_uses_the_first_gains_only():
    estimator = build(paper_schedule(2, position_duration=60.0), passes=1)
    assert estimator.later is None
    assert estimator.gains(0) is estimator.first


def test_gains_are_those_of_the_recursion():
    schedule = paper_schedule(3, position_duration=60.0)
    transitions = build_transitions(schedule, SITE, StateModel(), NOISE, update_interval=1.0)
    plain = compute_gains(transitions, StateModel(), NOISE, STD)
    assert (build(schedule).first.gain == plain.gain).all()
