"""Passes until a run has converged, runs that start anew, and the verdict on a run's own data."""

import dataclasses

import numpy as np
import pytest
from conftest import paper_schedule, paper_truth
from scipy import stats

from inscal import convergence, parameters
from inscal.calibrator import calibrate
from inscal.convergence import BEYOND_LIMIT, NOT_CONVERGED, NOT_FINITE, REASONS
from inscal.estimator import CONSTANTS, Belief, build_estimator
from inscal.experiment import prepare, run, run_with_history
from inscal.kernel import LANES
from inscal.motion import Site
from inscal.parameters import COUNT
from inscal.record import Record
from inscal.recursion import InitialStd
from inscal.simulation import Truth, TruthModel, Workspace, simulate
from inscal.state_model import NoiseModel

SITE = Site(np.deg2rad(39.98), 50.0)
NOISE = NoiseModel(1.5e-7, 5e-5, 1e-3, 0.1)
SIZE = paper_truth() * parameters.si_units(1673.84e-9)
STD = InitialStd(np.deg2rad([0.1, 0.1, 0.5]), 0.01, 1.0, SIZE)
SCHEDULE = paper_schedule(9, position_duration=60.0)


def louder(factor):
    return NoiseModel(*(factor * np.array(dataclasses.astuple(NOISE))))


def experiment_on(schedule=SCHEDULE, *, noise=NOISE, met=None, std=STD, site=SITE, **belief):
    """Experiment whose filter believes in `noise`, which the runs meet if they do not `met`."""
    belief = {"passes": 2, "max_passes": 12, **belief}
    return prepare(
        3,
        schedule,
        site,
        Truth(TruthModel("normal", std.parameter), met or noise, std),
        Belief(noise, std, update_interval=1.0, **belief),
        dwell_step=1.0,
        turn_step=0.5,
    )


def record_of(experiment, truth=None):
    if truth is None:
        truth = SIZE[:, None] * np.random.default_rng(1).standard_normal((27, LANES))
    return simulate(
        truth,
        experiment.motion,
        experiment.truth.noise,
        experiment.truth.initial,
        seed=4,
        runs=range(LANES),
        workspace=Workspace.of(experiment.motion),
    )


def calibration_of(experiment, record):
    return calibrate(record, experiment.motion, experiment.site, experiment.estimator)


@pytest.fixture(scope="module")
def quiet():
    """A thirtieth of the noise: some first passes run away."""
    return experiment_on(noise=louder(0.03))


# passes


def test_reference_case_needs_no_pass_beyond_the_two():
    judged = experiment_on(paper_schedule())
    plain = experiment_on(paper_schedule(), max_passes=None)
    assert judged.estimator.judged
    assert not plain.estimator.judged
    outcome = run(judged, range(64))
    assert (outcome.passes == 2).all()
    assert not outcome.reason.any()
    # and being judged does not touch a result
    assert outcome.estimate.tobytes() == run(plain, range(64)).estimate.tobytes()


def test_runs_that_ran_away_start_anew_and_are_as_good_as_others(quiet):
    two = dataclasses.replace(quiet.estimator, max_passes=2)
    lost = run(dataclasses.replace(quiet, estimator=two), range(128)).failed
    assert lost.sum() > 5
    outcome = run(quiet, range(128))
    assert not outcome.failed.any()
    assert (outcome.passes[lost] > 2).all()
    assert outcome.nees[lost].mean() == pytest.approx(outcome.nees[~lost].mean(), abs=6)
    assert outcome.nees.mean() == pytest.approx(27, abs=4 * np.sqrt(54 / 128))


@pytest.mark.parametrize(
    "change",
    [
        {"noise": louder(1e-3)},
        {"std": dataclasses.replace(STD, parameter=10 * SIZE)},
        {"std": dataclasses.replace(STD, attitude=np.deg2rad([5.0, 5.0, 5.0]))},
        {"site": Site(np.deg2rad(-89.9), 0.0)},
    ],
    ids=["noise", "prior", "attitude", "pole"],
)
def test_consistent_wherever_a_laboratory_may_stand(change):
    outcome = run(experiment_on(paper_schedule(), **change), range(96))
    assert not outcome.failed.any()
    assert outcome.nees.mean() == pytest.approx(27, abs=4 * np.sqrt(54 / 96))


def test_where_passes_start_does_not_change_the_estimate():
    """One maximum a posteriori estimate, from a first pass or from the prior's mean."""
    experiment = experiment_on(paper_schedule(25, position_duration=60.0), passes=6)
    record = record_of(experiment)
    usual = calibration_of(experiment, record)
    first = experiment.estimator.first
    broken = dataclasses.replace(first, gain=np.full_like(first.gain, np.nan))
    estimator = dataclasses.replace(experiment.estimator, first=broken)
    anew = calibration_of(dataclasses.replace(experiment, estimator=estimator), record)
    assert not usual.reason.any()
    assert not anew.reason.any()
    sigma = experiment.estimator.predicted_std[:, None]
    assert (np.abs(anew.estimate - usual.estimate) / sigma).max() < 1e-3
    assert (np.abs(usual.estimate) / sigma).max() > 100


def test_outcomes_with_unlike_numbers_of_passes_do_not_depend_on_neighbours(quiet):
    whole = run(quiet, range(40))
    assert len(set(whole.passes)) > 1
    for size in (1, 13):
        parts = [run(quiet, range(40)[first : first + size]) for first in range(0, 40, size)]
        for name in ("estimate", "nees", "failed", "passes", "reason"):
            joined = np.concatenate([getattr(part, name) for part in parts])
            assert joined.tobytes() == getattr(whole, name).tobytes()


def test_course_is_as_long_as_the_run_had_passes(quiet):
    passes = run(quiet, range(20)).passes
    number = int(np.argmax(passes))
    outcome, history = run_with_history(quiet, number)
    assert len(history.estimate) == outcome.passes[0] == passes[number] > 2
    assert np.isfinite(history.innovation[-1]).all()


def test_convergence_is_asked_of_every_constant():
    estimator = experiment_on().estimator
    sigma = np.sqrt(np.diag(estimator.first.covariance))
    result = np.zeros((CONSTANTS, 3))
    step = np.zeros((CONSTANTS, 3))
    step[:, 0], step[29, 1] = 0.009 * sigma, 0.011 * sigma[29]
    step[4, 2] = np.nan
    later = convergence.have_converged(estimator, 3, step, result)
    np.testing.assert_array_equal(later, [True, False, False])
    # without any parameters there is nothing that the passes of every run could have left
    after_all = convergence.have_converged(estimator, 2, 100 * step, result)
    np.testing.assert_array_equal(after_all, [True, True, False])


def test_expected_change_is_the_product_of_step_and_parameters():
    estimator = experiment_on().estimator
    sigma = np.sqrt(np.diag(estimator.first.covariance))
    index = {name: number for number, name in enumerate(parameters.NAMES)}
    step, result = np.zeros((CONSTANTS, 2)), np.zeros((CONSTANTS, 2))
    step[index["accel_k12"]] = 1e-6
    result[index["accel_k21"], 0] = 1e-3  # of D K that is an entry 11, known well
    result[index["accel_k33"], 1] = 1e-3  # of D K nothing; what is left is of the order of both
    expected = convergence.expected_change(estimator, step, result)
    own = 1e-9 / sigma[index["accel_k12"]]
    np.testing.assert_allclose(expected, [max(1e-9 / sigma[index["accel_k11"]], own), own])


def test_expected_change_tells_who_needs_a_further_pass():
    wide = dataclasses.replace(STD, parameter=5 * SIZE)
    truth = 5 * SIZE[:, None] * np.random.default_rng(1).standard_normal((27, LANES))
    seen = []
    for passes in (1, 2, 3):
        experiment = experiment_on(paper_schedule(), std=wide, passes=passes, max_passes=None)
        record = record_of(experiment, truth=truth)
        seen.append(calibration_of(experiment, record).estimate)
    step, change = np.diff(seen, axis=0)
    none = np.zeros((3, LANES))
    expected = convergence.expected_change(
        experiment.estimator, np.concatenate([step, none]), np.concatenate([seen[1], none])
    )
    change = (np.abs(change) / experiment.estimator.predicted_std[:, None]).max(axis=0)
    assert change.max() > 0.5
    assert (change[expected < 0.2] < 0.3).all()
    assert (expected < 0.2).any()


# verdicts


def contradicted(experiment, outcome):
    lower, upper = convergence.chance_limits(experiment.motion.updates)
    return (outcome.innovation_ratio < lower) | (outcome.innovation_ratio > upper)


def test_no_false_alarm_and_no_missed_one():
    experiment = experiment_on()
    outcome = run(experiment, range(256))
    assert not outcome.failed.any()
    assert not contradicted(experiment, outcome).any()
    for factor in (0.7, 1.5):
        outcome = run(experiment_on(met=louder(factor)), range(64))
        assert not outcome.failed.any()
        assert contradicted(experiment, outcome).all()
        assert outcome.innovation_ratio.mean() == pytest.approx(factor**2, rel=0.05)


def test_a_run_beyond_the_limit_has_failed():
    outcome = run(experiment_on(met=louder(3.0), innovation_limit=9.0), range(64))
    over = outcome.innovation_ratio > 9.0
    assert 0 < over.sum() < 64
    assert (outcome.failed == over).all()
    assert (outcome.reason == np.where(over, BEYOND_LIMIT, 0)).all()
    assert np.isnan(outcome.nees[over]).all()


def test_runs_that_nobody_judges_have_no_ratio():
    assert np.isnan(run(experiment_on(max_passes=None), range(4)).innovation_ratio).all()


def test_innovations_are_chi_square_once_the_step_is_taken_off():
    experiment = experiment_on(passes=3)
    count = 6 * experiment.motion.updates
    own = count * run(experiment, range(512)).innovation_ratio
    # the constants that the record tells are no longer among its degrees of freedom
    assert own.mean() == pytest.approx(count - CONSTANTS, abs=4 * np.sqrt(2 * count / 512) + 10)
    assert own.std() == pytest.approx(np.sqrt(2 * count), rel=0.15)


def test_beyond_chance_is_one_in_a_million_on_either_side():
    low, high = convergence.chance_limits(500)
    # fewer degrees of freedom below, by all constants
    assert low == pytest.approx(stats.chi2.ppf(5e-7, 3000 - CONSTANTS) / 3000)
    assert high == pytest.approx(stats.chi2.isf(5e-7, 3000) / 3000)


def test_a_run_has_only_so_many_passes():
    outcome = run(experiment_on(passes=1, max_passes=3, convergence_sigma=0.0), range(32))
    assert (outcome.reason == NOT_CONVERGED).all()
    assert (outcome.passes == 3).all()
    assert np.isnan(outcome.estimate).all()


def test_a_record_that_is_no_record_fails_alone():
    experiment = experiment_on()
    record = record_of(experiment)
    together = calibration_of(experiment, record)
    record.sensors[50, 4, 3] = np.nan
    broken = calibration_of(experiment, Record(**vars(record)))
    assert broken.reason[3] == NOT_FINITE
    assert REASONS[broken.reason[3]] == "estimates are not finite"
    assert broken.passes[3] == 2  # one of them anew
    others = np.arange(LANES) != 3
    assert (broken.estimate[:, others] == together.estimate[:, others]).all()


# what sharing the covariance costs


def test_excess_of_errors_too_large_for_the_noise_is_foretold():
    silent = dataclasses.replace(NOISE, accel=0.0)
    experiment = experiment_on(paper_schedule(), noise=silent)
    excess = convergence.expected_excess(experiment.estimator, SIZE)
    outcome = run(experiment, range(512))
    found, spread = outcome.nees.mean() - COUNT, outcome.nees.std() / np.sqrt(512)
    assert excess > 4.0 * spread
    assert excess - 4.0 * spread < found < 2.0 * excess + 4.0 * spread
    # it goes with the square of the errors
    tenth = convergence.expected_excess(experiment.estimator, 0.1 * SIZE)
    assert tenth == pytest.approx(0.01 * excess)
    reference = experiment_on(paper_schedule())
    assert convergence.expected_excess(reference.estimator, SIZE) < 1e-3


# refusals


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"noise": dataclasses.replace(NOISE, velocity=0.0)}, "needs both above zero"),
        ({"noise": dataclasses.replace(NOISE, position=0.0)}, "needs both above zero"),
        ({"std": dataclasses.replace(STD, parameter=0.0 * SIZE)}, "sigma of gyro_bias_x is 0"),
        ({"std": dataclasses.replace(STD, attitude=np.zeros(3))}, "the attitude at the start is 0"),
        ({"std": dataclasses.replace(STD, velocity=np.inf)}, "is nan"),
        ({"max_passes": 1}, "at most 1 passes, but every run gets 2"),
    ],
)
def test_what_cannot_work_is_refused_beforehand(change, message):
    belief = {"noise": NOISE, "prior": change.pop("std", STD), "passes": 2, **change}
    with pytest.raises(ValueError, match=message), np.errstate(all="ignore"):
        build_estimator(SCHEDULE, SITE, Belief(update_interval=1.0, **belief))


@pytest.mark.parametrize("degrees", [90.0, -89.995, np.nan])
def test_no_site_at_a_pole(degrees):
    with pytest.raises(ValueError, match=r"North, East, Down axes reach to 89\.99 deg"):
        Site(np.deg2rad(degrees), 0.0)
