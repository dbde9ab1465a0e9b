"""The gate's verdicts: the same code, harmless changes, and defects planted to be found."""

from dataclasses import replace

import numpy as np
import planted
import pytest

from inscal import regression
from inscal.campaign_checks import LOOKS
from pipeline.config.load import load
from pipeline.config.setup import Setup
from pipeline.gate import baseline, judge, power


def test_the_same_code_is_identical(clean, bound):
    again = baseline.sample_of(planted.reference())
    judgement = regression.judge(clean, again, bound)
    assert judgement.verdict == "identical"
    assert judgement.same_data
    assert judge.lines(judgement) == []


def test_rounding_is_no_loss(clean, bound):
    shaken = planted.with_gain(lambda gain: gain * (1 + 1e-13))
    new = baseline.sample_of(shaken)
    assert 0 < np.abs(new.error / clean.error - 1).max()
    new = replace(new, sketch=new.sketch + 1e-6)  # as another processor would sum
    judgement = regression.judge(clean, new, bound)
    assert judgement.verdict == "changed, no worse"
    assert judgement.same_data
    assert len(judge.lines(judgement)) == 2


def test_a_change_of_the_errors_alone_is_not_identical(clean, bound):
    error = clean.error.copy()
    error[5, 5] = np.nextafter(error[5, 5], 1.0)
    new = replace(clean, error=error)
    assert regression.judge(clean, new, bound).verdict == "changed, no worse"


@pytest.mark.parametrize(
    "overrides",
    [
        ["campaign.seed=1"],
        ["campaign.seed=2"],
        ["simulation.turn_step_s=0.25"],
        ["estimator.passes=3"],
        ["estimator.initial_std.lever_arm_mm=40"],
    ],
    ids=str,
)
def test_harmless_changes_are_no_worse(clean, bound, overrides):
    new = baseline.sample_of(Setup(load(overrides)).experiment)
    judgement = regression.judge(clean, new, bound)
    assert judgement.verdict == "changed, no worse"
    assert judgement.same_data == overrides[0].startswith("estimator")


def test_a_gain_on_the_same_data_is_no_loss(clean, bound):
    # the baseline of a defect, and the campaign that mends it
    poor = baseline.sample_of(Setup(load(["estimator=one_pass"])).experiment)
    mended = regression.judge(poor, clean, bound)
    assert mended.same_data
    assert mended.verdict == "changed, no worse"
    names = {loss.name for loss in regression.judge(clean, poor, bound).losses}
    assert {"accel_k11", "accel_scale_factor", "accel_k", "all"} <= names


# what each defect must be found by: comparisons of some look, or a check
PLANTED = [
    (planted.earth_rate_missing_in_filter, "gyro_bias"),
    (planted.gravity_of_1967, "accel_scale_factor"),
    (planted.midpoint_rule_in_turns, "accel_scale_factor"),
    (planted.every_second_update_skipped, "lever_arm"),
    (planted.updates_of_one_position_skipped, "lever_arm_y"),
    (planted.translation_missing, "accel_k11"),
    (planted.prior_counted_twice, "accel_k22"),
    (planted.one_pass, "accel_k11"),
    (planted.estimates_swapped, "accel_k21"),
    (planted.latitude_an_arcminute_off, "accel_k33"),
    (planted.arcsec_of_three_digits, "accel_installation"),
    (planted.quadratic_sign_in_truth, "accel_quadratic"),
    (planted.lever_arm_sign_in_truth, "lever_arm"),
    (planted.observation_noise_under_modelled, "mean NEES"),
    (planted.sensor_noise_under_modelled, "gyro_bias"),
    (planted.covariance_too_small, "mean NEES"),
    (planted.noise_of_run_0_in_all, "mean error"),
    (planted.noise_shared_by_pairs_of_runs, "likeness of two runs"),
]

DIVERGING = [
    planted.velocity_and_position_gains_swapped,
    planted.upper_gyro_matrix_in_filter,
    planted.sensor_noise_missing_in_filter,
    planted.earth_rate_missing_in_truth,
    planted.one_run_diverges,
    planted.lever_arm_column_sign,
    planted.start_attitude_not_smoothed,
]


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize(("defect", "found"), PLANTED, ids=lambda v: getattr(v, "__name__", None))
def test_a_planted_defect_is_worse(clean, bound, monkeypatch, defect, found):
    judgement = regression.judge(clean, baseline.sample_of(defect(monkeypatch)), bound)
    assert judgement.verdict == "worse"
    names = [loss.name for loss in judgement.losses]
    names += [check.name for check in judgement.checks if not check.passed]
    assert found in names
    assert any(line.startswith(found) for line in judge.lines(judgement))


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("defect", DIVERGING, ids=lambda v: v.__name__)
def test_a_defect_that_makes_runs_diverge_is_worse(clean, bound, monkeypatch, defect):
    judgement = regression.judge(clean, baseline.sample_of(defect(monkeypatch)), bound)
    assert judgement.verdict == "worse"
    assert judgement.failed > 0
    assert judge.lines(judgement) == [f"{judgement.failed} runs diverged"]


# a defect without a loss is a change, and no more; a gain one update late loses 2.5 % in one lever
# arm, less than the gate's tolerance
HARMLESS = [planted.initial_attitude_too_sure, planted.pull_missing, planted.gain_one_update_late]


@pytest.mark.parametrize("defect", HARMLESS, ids=lambda v: v.__name__)
def test_a_defect_that_costs_nothing_is_a_change(clean, bound, monkeypatch, defect):
    judgement = regression.judge(clean, baseline.sample_of(defect(monkeypatch)), bound)
    assert judgement.verdict == "changed, no worse"


def test_other_streams_are_other_data(clean, bound, monkeypatch):
    new = baseline.sample_of(planted.one_stream_for_sensors_and_observations(monkeypatch))
    judgement = regression.judge(clean, new, bound)
    assert not judgement.same_data
    assert "other data" in judge.lines(judgement)[0]


@pytest.mark.parametrize("spoil", [power.scaled, power.independent])
@pytest.mark.parametrize("look", power.POOLS)
def test_five_percent_of_a_group_is_found_and_named(clean, bound, spoil, look):
    gate = power.Gate(clean.covariance, bound)
    error = clean.error.copy()
    members = LOOKS[look]
    rng = np.random.default_rng(8)
    error[:, members] = spoil(rng, error[:, members], gate.std[members], 1.05)
    judgement = gate.judge(clean.error, error, same_data=True)
    assert look in [loss.name for loss in judgement.losses]
    unhurt = {name for name, i in LOOKS.items() if not np.isin(i, members).any()}
    assert not unhurt & {loss.name for loss in judgement.losses}
