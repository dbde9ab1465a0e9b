"""The error budget against the recursion, against single runs, and against campaigns."""

import numpy as np
import pytest
from disturbed_case import (
    SCHEDULE,
    SIZE,
    SIZES,
    disturbed_by,
    every_system,
    filtered,
    plain,
    system_of,
)

from inscal.budget import budget, sensitivity
from inscal.disturbance import COMPONENTS, PROCESSES, draw_constants
from inscal.experiment import run

SOURCES = [source for source in COMPONENTS if source != "observation_delay"]


@pytest.fixture(scope="module")
def effects():
    return budget(every_system()).effects


@pytest.fixture(scope="module")
def undisturbed():
    return run(plain(), range(32)).estimate


def test_noise_and_priors_add_up_to_what_the_filter_claims():
    made = budget(system_of(plain()))
    covariance = filtered()[1].covariance[:27, :27]
    sigma = np.sqrt(np.diag(covariance))
    difference = (made.formal_covariance - covariance) / np.outer(sigma, sigma)
    assert np.abs(difference).max() < 1e-9
    assert made.disturbances == {}
    assert made.expected_nees == pytest.approx(27.0)
    assert set(made.formal) == {
        *("gyro_noise", "accel_noise", "velocity_noise", "position_noise"),
        *("prior_attitude", "prior_velocity", "prior_position", "prior_parameters"),
    }


@pytest.mark.parametrize("source", SOURCES)
def test_constants_move_a_whole_calibration_as_the_budget_says(undisturbed, effects, source):
    """Paired runs: what a drawn constant does to the estimates of the nonlinear calibrator."""
    experiment = disturbed_by(**{source: SIZES[source]})
    moved = run(experiment, range(32)).estimate - undisturbed
    drawn = draw_constants(
        experiment.truth.disturbance, source, len(SCHEDULE.turns), seed=9, runs=range(32)
    )
    expected = (effects[source] @ drawn).T
    sigma = np.sqrt(np.diag(filtered()[1].covariance)[:27])
    # beside the planned path the same noise does a little else: hundredths of a sigma
    scale = np.abs(expected / sigma).max()
    assert np.abs((moved - expected) / sigma).max() < 0.02 * scale + 0.02


LARGE = dict(
    **{"gyro_wander": 5e-8, "accel_wander": 5e-5, "gyro_flicker": 2e-8, "accel_flicker": 3e-5},
    **{
        "gyro_rate_random_walk": 1e-9,
        "accel_random_walk": 2e-6,
        "observation_correlation_time": 3.0,
    },
    **{"gyro_noise_factor": 1.4, "position_noise_factor": 0.5, "accel_quantisation": 2e-3},
)


def test_campaigns_have_the_rmse_that_the_budget_says():
    """Processes, pulses, correlation and noise that is not as believed, all at once."""
    disturbed = disturbed_by(**LARGE)
    outcome = run(disturbed, range(1024))
    made = budget(system_of(disturbed))
    assert {*PROCESSES, "accel_quantisation"} < set(made.disturbances)
    true, formal = (np.sqrt(np.diag(c)) for c in (made.true_covariance, made.formal_covariance))
    assert (true / formal).max() > 3.0
    rmse = np.sqrt(np.square(outcome.estimate - outcome.truth).mean(axis=0))
    # 5 standard errors of 27 looks; what is correlated over a second is not quite linear here
    assert np.abs(rmse / true - 1.0).max() < 5.0 / np.sqrt(2 * 1024)
    assert outcome.nees.mean() == pytest.approx(made.expected_nees, rel=0.1)


def test_sources_add_up():
    made = budget(system_of(disturbed_by(**LARGE)))
    total = sum([*made.formal.values(), *made.disturbances.values()])
    np.testing.assert_allclose(made.true_covariance, total, rtol=1e-12, atol=1e-40)
    for name, factor in (("gyro", 1.4), ("position", 0.5)):
        added = made.disturbances[f"{name}_noise_factor"]
        expected = (factor**2 - 1.0) * made.formal[f"{name}_noise"]
        np.testing.assert_allclose(added, expected, rtol=1e-12)
    for source in PROCESSES:
        assert np.linalg.eigvalsh(made.disturbances[source] / np.outer(SIZE, SIZE))[0] > -1e-9


def test_a_budget_after_some_updates_is_of_the_filter_there():
    """Against the recursion's own sigma in mid course, and the last one's rows."""
    system = system_of(disturbed_by(**LARGE, gravity=1e-5))
    last, updates = len(system.transitions.index), 700
    chosen = [5, 21]
    early = budget(system, parameters=chosen, updates=updates)
    claimed = system.gains.parameter_std[updates - 1, chosen]
    np.testing.assert_allclose(np.sqrt(np.diag(early.formal_covariance)), claimed, rtol=1e-6)
    final, whole = budget(system, parameters=chosen, updates=last), budget(system)
    for source, covariance in whole.disturbances.items():
        part = final.disturbances[source]
        np.testing.assert_allclose(part, covariance[np.ix_(chosen, chosen)], rtol=1e-7)
    found = sensitivity(system.transitions, system.gains, system.model, updates=updates)
    assert not found.process[updates:].any()
    assert not found.observation[updates:].any()
