"""The error budget against the recursion, against single runs, and against campaigns."""

import dataclasses

import numpy as np
import pytest
from conftest import paper_schedule, paper_truth

from inscal import parameters
from inscal.budget import budget
from inscal.disturbance import COMPONENTS, PROCESSES, Disturbance, draw_constants
from inscal.disturbed import disturb
from inscal.estimator import Belief
from inscal.experiment import prepare, run
from inscal.motion import Site
from inscal.recursion import InitialStd, compute_gains
from inscal.simulation import Truth, TruthModel
from inscal.state_model import NoiseModel, StateModel, build_transitions

SITE = Site(np.deg2rad(39.98), 50.0)
NOISE = NoiseModel(1.5e-7, 5e-5, 1e-3, 0.1)
SIZE = paper_truth() * parameters.si_units(1673.84e-9)
STD = InitialStd(np.deg2rad([0.01, 0.01, 0.05]), 0.01, 1.0, 0.1 * SIZE)
SCHEDULE = paper_schedule(25, position_duration=60.0)
TIMES = {"gyro_wander_time": 200.0, "accel_wander_time": 200.0, "vibration_frequency": 3.3}
MODEL = StateModel()
SOURCES = [source for source in COMPONENTS if source != "observation_delay"]


def experiment_of(disturbance):
    return prepare(
        9,
        SCHEDULE,
        SITE,
        Truth(TruthModel("fixed", np.zeros(27)), NOISE, STD, disturbance),
        Belief(NOISE, STD, passes=2, update_interval=1.0),
        dwell_step=1.0,
        turn_step=0.1,
    )


@pytest.fixture(scope="module")
def filtered():
    transitions = build_transitions(SCHEDULE, SITE, MODEL, NOISE, update_interval=1.0)
    return transitions, compute_gains(transitions, MODEL, NOISE, STD)


@pytest.fixture(scope="module")
def plain():
    return experiment_of(Disturbance())


def with_(plain, disturbance):
    made = disturb(
        disturbance,
        SCHEDULE,
        SITE,
        plain.motion,
        update_interval=1.0,
        dwell_step=1.0,
        turn_step=0.1,
    )
    truth = dataclasses.replace(plain.truth, disturbance=disturbance)
    return dataclasses.replace(plain, truth=truth, disturbed=made)


def budget_of(filtered, experiment):
    about = experiment.truth.disturbance
    return budget(*filtered, MODEL, NOISE, STD, experiment.disturbed, about)


@pytest.fixture(scope="module")
def effects(filtered, plain):
    return budget_of(filtered, with_(plain, Disturbance(**SIZES, **TIMES))).effects


@pytest.fixture(scope="module")
def undisturbed(plain):
    return run(plain, range(32)).estimate


def test_noise_and_priors_add_up_to_what_the_filter_claims(filtered, plain):
    made = budget_of(filtered, plain)
    covariance = filtered[1].covariance[:27, :27]
    sigma = np.sqrt(np.diag(covariance))
    difference = (made.formal_covariance - covariance) / np.outer(sigma, sigma)
    assert np.abs(difference).max() < 1e-9
    assert made.disturbances == {}
    assert made.expected_nees == pytest.approx(27.0)
    assert set(made.formal) == {
        *("gyro_noise", "accel_noise", "velocity_noise", "position_noise"),
        *("prior_attitude", "prior_velocity", "prior_position", "prior_parameters"),
    }


# sizes that move some estimate by about a sigma, and others by no more
SIZES = {
    **{"gyro_drift": 1e-8, "accel_drift": 1e-5, "gyro_scale_drift": 1e-6},
    **{"accel_scale_drift": 1e-6, "off_axis_lever_arm": 1e-3, "table_offset": 1e-3},
    **{"gyro_accel_delay": 1e-5, "accel_asymmetry": 1e-6, "accel_cubic": 1e-8},
    **{"accel_cross_coupling": 1e-7, "accel_pendulous": 1e-7, "gyro_asymmetry": 1e-6},
    **{"gyro_g_sensitivity": 1e-10, "gravity": 1e-5, "latitude": 1e-5, "deflection": 1e-5},
    **{"turn_angle": 1e-5, "turn_rate": 1e-5, "table_axis": 1e-5, "base_tilt": 1e-4},
    **{"vibration": 1e-2, "observation_bias": 1e-4},
}


@pytest.mark.parametrize("source", SOURCES)
def test_constants_move_a_whole_calibration_as_the_budget_says(
    filtered, plain, undisturbed, effects, source
):
    """Paired runs: what a drawn constant does to the estimates of the nonlinear calibrator."""
    experiment = with_(plain, Disturbance(**{source: SIZES[source]}, **TIMES))
    moved = run(experiment, range(32)).estimate - undisturbed
    drawn = draw_constants(
        experiment.truth.disturbance, source, len(SCHEDULE.turns), seed=9, runs=range(32)
    )
    expected = (effects[source] @ drawn).T
    sigma = np.sqrt(np.diag(filtered[1].covariance)[:27])
    # beside the planned path the same noise does a little else: hundredths of a sigma
    scale = np.abs(expected / sigma).max()
    assert np.abs((moved - expected) / sigma).max() < 0.02 * scale + 0.02


LARGE = Disturbance(
    **{"gyro_wander": 5e-8, "accel_wander": 5e-5, "gyro_flicker": 2e-8, "accel_flicker": 3e-5},
    **{
        "gyro_rate_random_walk": 1e-9,
        "accel_random_walk": 2e-6,
        "observation_correlation_time": 3.0,
    },
    **{"gyro_noise_factor": 1.4, "position_noise_factor": 0.5, "accel_quantisation": 2e-3},
    **TIMES,
)


def test_campaigns_have_the_rmse_that_the_budget_says(filtered, plain):
    """Processes, pulses, correlation and noise that is not as believed, all at once."""
    disturbed = with_(plain, LARGE)
    outcome = run(disturbed, range(1024))
    made = budget_of(filtered, disturbed)
    assert set(PROCESSES) < set(made.disturbances)
    true, formal = (np.sqrt(np.diag(c)) for c in (made.true_covariance, made.formal_covariance))
    assert (true / formal).max() > 3.0
    rmse = np.sqrt(np.square(outcome.estimate - outcome.truth).mean(axis=0))
    # 5 standard errors of 27 looks; what is correlated over a second is not quite linear here
    assert np.abs(rmse / true - 1.0).max() < 5.0 / np.sqrt(2 * 1024)
    assert outcome.nees.mean() == pytest.approx(made.expected_nees, rel=0.1)


def test_sources_add_up(filtered, plain):
    made = budget_of(filtered, with_(plain, LARGE))
    total = sum([*made.formal.values(), *made.disturbances.values()])
    np.testing.assert_allclose(made.true_covariance, total, rtol=1e-12, atol=1e-40)
    assert (np.diag(made.disturbances["position_noise_factor"]) <= 0.0).all()
    for source in PROCESSES:
        assert np.linalg.eigvalsh(made.disturbances[source] / np.outer(SIZE, SIZE))[0] > -1e-9
