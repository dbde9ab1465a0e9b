import numpy as np
import pytest
from conftest import paper_schedule, paper_truth
from scipy.stats import chi2

from inscal import parameters
from inscal.estimator import Belief
from inscal.experiment import prepare, run, run_with_history
from inscal.motion import Site
from inscal.recursion import InitialStd
from inscal.simulation import Truth, TruthModel, Workspace
from inscal.state_model import NoiseModel, StateModel
from pipeline.config.load import load
from pipeline.config.setup import Setup

SITE = Site(np.deg2rad(39.98), 50.0)
NOISE = NoiseModel(1.5e-7, 5e-5, 1e-3, 0.1)
SIZE = paper_truth() * parameters.si_units(1673.84e-9)
STD = InitialStd(np.deg2rad([0.1, 0.1, 0.5]), 0.01, 1.0, SIZE)


def experiment_on(schedule, truth=None, model=None):
    return prepare(
        3,
        schedule,
        SITE,
        Truth(truth or TruthModel("normal", SIZE), NOISE, STD),
        Belief(NOISE, STD, passes=2, update_interval=1.0, model=model or StateModel()),
        dwell_step=1.0,
        turn_step=0.2,
    )


@pytest.fixture(scope="module")
def experiment():
    return experiment_on(paper_schedule(5, position_duration=60.0))


def test_outcomes_are_the_same_to_the_last_bit_however_grouped(experiment):
    whole = run(experiment, range(40))
    workspace = Workspace.of(experiment.motion)
    for size in (1, 7, 16, 25):
        parts = [
            run(experiment, range(first, min(first + size, 40)), workspace)
            for first in range(0, 40, size)
        ]
        for name in ("truth", "estimate", "nees", "failed"):
            joined = np.concatenate([getattr(part, name) for part in parts])
            assert joined.tobytes() == getattr(whole, name).tobytes()
    backwards = run(experiment, range(39, -1, -1))
    assert backwards.estimate[::-1].tobytes() == whole.estimate.tobytes()


def test_repeated_run_is_the_same_and_has_a_course(experiment):
    whole = run(experiment, range(20))
    outcome, history = run_with_history(experiment, 17)
    assert outcome.estimate[0].tobytes() == whole.estimate[17].tobytes()
    assert outcome.nees[0] == whole.nees[17]
    assert history.estimate.shape == (2, 300, 27, 1)
    assert np.isfinite(history.innovation).all()


def test_errors_match_the_predicted_covariance():
    """A short path keeps much of the prior: consistent only if the prior is counted once."""
    experiment = experiment_on(paper_schedule(9, position_duration=60.0))
    outcome = run(experiment, range(480))
    ratio = (outcome.estimate - outcome.truth).std(axis=0) / experiment.estimator.predicted_std
    assert (experiment.estimator.predicted_std > 0.1 * SIZE).any()
    assert ratio.min() > 0.85
    assert ratio.max() < 1.15
    assert outcome.nees.mean() == pytest.approx(27, abs=5 * np.sqrt(54 / 480))


def test_diverged_runs_are_marked_and_harm_no_others(experiment):
    size = SIZE.copy()
    size[parameters.INDEX["accel_quadratic"]] *= 700.0  # a root of the quadratic may not exist
    wild = experiment_on(paper_schedule(2, position_duration=40.0), TruthModel("normal", size))
    outcome = run(wild, range(64))
    assert 0 < outcome.failed.sum() < 64
    assert np.isnan(outcome.estimate[outcome.failed]).all()
    assert np.isnan(outcome.nees[outcome.failed]).all()
    assert np.isfinite(outcome.estimate[~outcome.failed]).all()
    alone = run(wild, np.flatnonzero(~outcome.failed)[:3].tolist())
    assert (alone.estimate == outcome.estimate[~outcome.failed][:3]).all()


def test_nees_counts_modelled_parameters_only():
    model = StateModel(("gyro_bias", "accel_bias", "gyro_k", "accel_k"))
    size = SIZE.copy()
    size[parameters.INDEX["accel_quadratic"]] = size[parameters.INDEX["lever_arm"]] = 0.0
    classic = experiment_on(
        paper_schedule(5, position_duration=60.0), TruthModel("normal", size), model
    )
    outcome = run(classic, range(320))
    assert (outcome.estimate[:, 21:] == 0).all()
    assert outcome.nees.mean() == pytest.approx(21, abs=5 * np.sqrt(42 / 320))


def test_ramps_known_to_truth_and_filter_leave_it_consistent():
    """The reference case with turns that a table can do."""
    experiment = Setup(load(["schedule.turn_acceleration_deg_per_s2=20"])).experiment
    assert experiment.motion.ramp.any()
    outcome = run(experiment, range(128))
    assert not outcome.failed.any()
    low, high = chi2.ppf([0.5e-4, 1.0 - 0.5e-4], 128 * 27) / 128
    assert low < outcome.nees.mean() < high
    square = np.square((outcome.estimate - outcome.truth) / experiment.estimator.predicted_std)
    # of all 27 at once one in ten thousand
    low, high = chi2.ppf([0.5e-4 / 27, 1.0 - 0.5e-4 / 27], 128)
    assert low < square.sum(axis=0).min()
    assert square.sum(axis=0).max() < high
