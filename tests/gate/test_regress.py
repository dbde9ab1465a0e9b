"""The gate: its statistics, its verdicts, its files, and defects planted for it to find."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import planted
import pytest
from campaigns import run_stage
from scipy import stats

from inscal import regression
from inscal.parameters import COUNT, NAMES
from inscal.regression import LOOKS, Sample
from pipeline import regress
from pipeline.config.load import load
from pipeline.config.setup import Setup
from pipeline.console.errors import DataError
from pipeline.gate import baseline, history, judge, power

COMMITTED = Path(__file__).resolve().parents[2] / "results" / "baseline"


@pytest.fixture(scope="module")
def clean():
    """The gate's campaign of this code."""
    return baseline.sample_of(planted.reference())


@pytest.fixture(scope="module")
def bound(reference):
    return Setup(reference).bound * Setup(reference).unit


def some_covariance():
    rng = np.random.default_rng(1)
    root = np.eye(COUNT) + 0.2 * rng.standard_normal((COUNT, COUNT))
    return root @ root.T * np.logspace(-4, 4, COUNT)[:, None] * np.logspace(-4, 4, COUNT)


def normal_errors(rng, covariance, runs=128):
    return rng.standard_normal((runs, COUNT)) @ np.linalg.cholesky(covariance).T


# statistics


def test_paired_ratio_is_pitmans_and_morgans_test_of_a_single_parameter():
    covariance = some_covariance()
    rng = np.random.default_rng(2)
    old = normal_errors(rng, covariance, 30)
    new = 1.3 * old + 0.5 * normal_errors(rng, covariance, 30)
    ratios = regression.paired_ratio(old, new, covariance)
    allowed = 1 + regression.TOLERANCE
    for i in range(COUNT):
        u, v = new[:, i] / allowed + old[:, i], new[:, i] / allowed - old[:, i]
        r = u @ v / np.sqrt(u @ u * (v @ v))
        p = stats.t.sf(r * np.sqrt(29 / (1 - r**2)), 29)
        assert ratios.p_worse[i] == pytest.approx(p, rel=1e-8)
        rms = np.sqrt((new[:, i] @ new[:, i]) / (old[:, i] @ old[:, i]))
        assert ratios.ratio[i] == pytest.approx(rms, rel=1e-12)
        # at the ends of the interval the same test has the p-value of the tails
        for end, tail in ((ratios.lower[i], 0.025), (ratios.upper[i], 0.975)):
            u, v = new[:, i] / end + old[:, i], new[:, i] / end - old[:, i]
            r = u @ v / np.sqrt(u @ u * (v @ v))
            assert stats.t.sf(r * np.sqrt(29 / (1 - r**2)), 29) == pytest.approx(tail, rel=1e-6)


@pytest.mark.parametrize("correlation", [0.0, 0.9])
def test_paired_ratio_holds_its_level_in_every_pool(correlation):
    covariance = some_covariance()
    rng = np.random.default_rng(3)
    below, trials = np.zeros(len(LOOKS)), 3000
    for _ in range(trials):
        old = normal_errors(rng, covariance)
        new = correlation * old + np.sqrt(1 - correlation**2) * normal_errors(rng, covariance)
        below += regression.paired_ratio(old, new, covariance).p_better < 0.05
    assert (stats.binom.cdf(below, trials, 0.05) > 1e-4).all()
    assert (stats.binom.sf(below - 1, trials, 0.05) > 1e-4).all()


def test_added_loss_is_the_mean_square_of_the_change():
    covariance = some_covariance()
    rng = np.random.default_rng(4)
    old = normal_errors(rng, covariance)
    std = np.sqrt(np.diag(covariance))
    change = 0.3 * std * rng.standard_normal(old.shape)
    ratios = regression.added_loss(old, old + change, covariance)
    excess = np.square(change / std).mean(axis=0)
    np.testing.assert_allclose(ratios.ratio[:COUNT] ** 2, 1 + excess, rtol=1e-9)
    assert ratios.ratio[-1] ** 2 == pytest.approx(1 + excess.mean())
    assert ((ratios.lower < ratios.ratio) & (ratios.ratio < ratios.upper)).all()


def test_added_loss_of_one_run_is_known_badly_and_of_all_well():
    covariance, old = np.eye(COUNT), np.zeros((128, COUNT))
    one, each = old.copy(), old.copy()
    one[0], each[:, :] = np.sqrt(128) * 0.4, 0.4  # the same mean square
    rare, steady = (regression.added_loss(old, new, covariance) for new in (one, each))
    np.testing.assert_allclose(rare.ratio, steady.ratio)
    assert (rare.p_worse > 1e-3).all()
    assert (steady.p_worse < 1e-20).all()
    assert (rare.upper > steady.upper).all()


def test_added_loss_agrees_with_what_optimal_estimates_lose():
    # x is seen in two ways of equal noise; the old estimate weighs them rightly, the new does not
    rng = np.random.default_rng(5)
    seen = rng.standard_normal((2, 200_000, COUNT))
    old, new = seen.mean(axis=0), 0.7 * seen[0] + 0.3 * seen[1]
    truth = np.sqrt((0.7**2 + 0.3**2) / 0.5)
    ratios = regression.added_loss(old, new, 0.5 * np.eye(COUNT))
    np.testing.assert_allclose(ratios.ratio, truth, rtol=3e-3)
    np.testing.assert_allclose(regression.paired_ratio(old, new, np.eye(COUNT)).ratio, truth, 0.01)


def test_looks_are_the_parameters_and_the_pools_of_them():
    assert list(LOOKS)[:COUNT] == list(NAMES)
    assert len(LOOKS) == 38
    assert [NAMES[i] for i in LOOKS["gyro_scale_factor"]] == ["gyro_k11", "gyro_k22", "gyro_k33"]
    assert {len(LOOKS[look]) for look in ("all", "accel_k", "accel_installation")} == {27, 9, 6}


def consistent(rng, covariance):
    error = normal_errors(rng, covariance)
    nees = np.square(np.linalg.solve(np.linalg.cholesky(covariance), error.T)).sum(axis=0)
    return Sample(error, covariance, nees, np.zeros(len(error)))


def failed_checks(sample):
    return [check.name for check in regression.consistency(sample) if not check.passed]


def test_each_check_finds_what_it_is_for():
    covariance = some_covariance()
    sample = consistent(np.random.default_rng(6), covariance)
    assert failed_checks(sample) == []
    assert failed_checks(replace(sample, nees=1.15 * sample.nees)) == ["mean NEES"]
    assert failed_checks(replace(sample, nees=0.85 * sample.nees)) == ["mean NEES"]
    shift = 0.3 * np.linalg.cholesky(covariance).sum(axis=1)
    assert failed_checks(replace(sample, error=sample.error + shift)) == ["mean error"]
    repeated = sample.error.copy()
    repeated[100] = -repeated[3]
    assert failed_checks(replace(sample, error=repeated)) == ["likeness of two runs"]


def test_checks_hold_their_level(monkeypatch):
    monkeypatch.setattr(regression, "CHECK_LEVEL", 0.05)
    covariance = some_covariance()
    rng = np.random.default_rng(7)
    failed = [failed_checks(consistent(rng, covariance)) for _ in range(2000)]
    for name in ("mean NEES", "mean error", "likeness of two runs"):
        hits = sum(name in names for names in failed)
        assert 1e-4 < stats.binom.cdf(hits, 2000, 0.05) < 1 - 1e-4, name


def test_bounds_count_runs_outside_and_let_the_expected_be():
    covariance = np.eye(COUNT)
    bound = np.full(COUNT, 30.0)
    bound[0] = 2.5
    error = np.zeros((128, COUNT))
    error[:7, 0], error[:3, 1], error[:2, 2] = 2.6, -31.0, 31.0
    checks = regression.bounds(error, covariance, bound)
    assert [check.value for check in checks[:4]] == [7, 3, 2, 0]
    # 1.6 of 128 runs are expected outside 2.5 sigma; outside 30 sigma, none
    assert [check.passed for check in checks] == [True, False] + [True] * 25
    assert checks[0].upper == stats.binom.isf(5e-5 / 27, 128, 2 * stats.norm.sf(2.5))


# verdicts


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
    (planted.lever_arm_column_sign, "lever_arm_x"),
    (planted.earth_rate_missing_in_filter, "gyro_bias"),
    (planted.gravity_of_1967, "accel_scale_factor"),
    (planted.midpoint_rule_in_turns, "accel_scale_factor"),
    (planted.every_second_update_skipped, "lever_arm"),
    (planted.updates_of_one_position_skipped, "lever_arm_y"),
    (planted.gain_one_update_late, "lever_arm_x"),
    (planted.start_attitude_not_smoothed, "accel_installation"),
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


# a defect without a loss is a change, and no more
HARMLESS = [planted.initial_attitude_too_sure, planted.pull_missing]


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


# files and command line


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(judge, "BASELINE", tmp_path / "baseline")
    return tmp_path / "baseline"


@pytest.fixture
def kept(folder, clean, reference):
    """The baseline of this code on disk."""
    baseline.write_baseline(folder, clean, reference, "of this test")
    return folder


def test_a_baseline_comes_back_bit_for_bit(kept, clean, reference):
    sample, about = baseline.read_baseline(kept)
    assert regression.identical(clean, sample)
    assert sample.sketch.tobytes() == clean.sketch.tobytes()
    assert about["reason"] == "of this test"
    assert about["configuration"] == baseline.configuration_of(reference)
    assert about["configuration"]["seed"] == reference.campaign.seed


def test_gate_passes_what_is_identical(kept):
    ended = run_stage(regress)
    assert (ended.code, ended.err) == (0, "")
    assert ended.out == "identical: 128 runs against the baseline: of this test\n"


def test_gate_passes_another_seed_and_says_so(kept):
    ended = run_stage(regress, "campaign.seed=1")
    assert (ended.code, ended.err) == (0, "")
    assert ended.out.startswith("changed, no worse: ")
    assert "configuration: seed = 20260101 -> 1\n" in ended.out
    assert "other data" in ended.out


def test_gate_stops_what_is_worse_with_names_and_intervals(kept):
    ended = run_stage(regress, "estimator=one_pass")
    assert (ended.code, ended.err) == (1, "")
    assert ended.out.startswith("worse: ")
    assert "configuration: estimator.passes = 2 -> 1\n" in ended.out
    assert "  accel_k: RMSE " in ended.out
    assert "(95 %: " in ended.out


def test_accepting_writes_a_baseline_with_its_reason(folder, clean):
    ended = run_stage(regress, "accept='a finer filter'")
    assert (ended.code, ended.err) == (0, "")
    assert json.loads((folder / "baseline.json").read_text())["reason"] == "a finer filter"
    first = {path.name: path.read_bytes() for path in folder.iterdir()}
    run_stage(regress, "accept='a finer filter'")
    second = {path.name: path.read_bytes() for path in folder.iterdir()}
    once, twice = (files.pop(history.FILE).splitlines() for files in (first, second))
    assert second == first
    assert twice == [*once, once[-1]]
    (row, _) = history.read(folder)
    assert (row.reason, row.runs) == ("a finer filter", baseline.RUNS)
    assert row.nees_mean == pytest.approx(clean.nees.mean(), rel=1e-5)
    assert regression.identical(clean, baseline.read_baseline(folder)[0])


@pytest.mark.parametrize("reason", ["''", "'  '"])
def test_accepting_takes_a_reason(folder, reason):
    ended = run_stage(regress, f"accept={reason}")
    assert ended.code == 2
    assert "must be the reason in words, not empty" in ended.err
    assert not folder.exists()


@pytest.mark.parametrize(
    ("defect", "said"),
    [(planted.covariance_too_small, "mean NEES: "), (planted.one_run_diverges, "runs diverged")],
    ids=["dishonest", "diverged"],
)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_what_is_not_consistent_is_no_baseline(folder, reference, monkeypatch, defect, said):
    experiment = defect(monkeypatch)
    monkeypatch.setattr(judge, "Setup", lambda config: SimpleNamespace(experiment=experiment))
    with pytest.raises(DataError, match=said):
        judge.accept(reference, "anyway")
    assert not folder.exists()


def test_gate_takes_a_filter_of_all_parameters(kept):
    ended = run_stage(regress, "estimator.states=[gyro_bias,accel_bias,gyro_k,accel_k]")
    assert ended.code == 2
    assert "estimator.states = " in ended.err


def remove(path):
    (path / "errors.csv").unlink()


def remove_all(path):
    shutil.rmtree(path)


def cut(path):
    text = (path / "errors.csv").read_text()
    (path / "errors.csv").write_text(text[: len(text) // 2])


def change_a_digit(path):
    text = (path / "covariance.csv").read_text()
    (path / "covariance.csv").write_text(text[:-2] + ("1" if text[-2] != "1" else "2") + "\n")


def break_json(path):
    (path / "baseline.json").write_text("{")


def other_json(path):
    (path / "baseline.json").write_text("[1]")


def no_reason(path):
    about = json.loads((path / "baseline.json").read_text())
    del about["reason"]
    (path / "baseline.json").write_text(json.dumps(about))


def binary(path):
    (path / "errors.csv").write_bytes(b"\xff\xfe\x00")


@pytest.mark.parametrize(
    "harm",
    [remove, remove_all, cut, change_a_digit, break_json, other_json, no_reason, binary],
    ids=lambda harm: harm.__name__,
)
def test_a_baseline_that_cannot_be_read_is_one_line(kept, harm):
    harm(kept)
    ended = run_stage(regress)
    assert (ended.code, ended.out) == (2, "")
    assert ended.err.startswith("error: ")
    assert "baseline" in ended.err
    assert ended.err.count("\n") == 1


def test_differences_name_the_key_and_both_values(reference):
    old = baseline.configuration_of(reference)
    new = baseline.configuration_of(load(["noise=quiet", "campaign.batch=7", "campaign.seed=4"]))
    lines = baseline.differences(old, new)
    assert "noise.position_observation_m = 0.1 -> 0.05" in lines
    assert "seed = 20260101 -> 4" in lines
    assert {line.split(".")[0].split(" ")[0] for line in lines} == {"noise", "seed"}
    assert baseline.differences(old, old) == []


def test_this_code_passes_the_committed_baseline(clean, bound):
    sample, _ = baseline.read_baseline(COMMITTED)
    judgement = regression.judge(sample, clean, bound)
    assert judgement.same_data
    assert judgement.verdict in ("identical", "changed, no worse")


# the study of the gate


def test_power_study_counts_alarms_and_losses(clean, bound):
    rng = np.random.default_rng(9)
    gate = power.Gate(clean.covariance, bound)
    blocks = np.array([normal_errors(rng, clean.covariance) for _ in range(6)])
    quiet = power.false_alarms(gate, power.block_pairs(blocks, 12, rng))
    assert (quiet["share"], quiet["of"]) == (0.0, 12)
    loud = power.false_alarms(gate, ((block, 3 * block) for block in blocks))
    assert (loud["share"], loud["comparisons"], loud["checks"]) == (1.0, 6, 6)
    assert loud["family_below_0.001"] == 1.0
    pairs = power.same_pairs(blocks, 8)
    found = power.power(gate, pairs, power.common, "lever_arm", 1.1, 0)
    assert (found["share"], found["of"], found["kind"]) == (1.0, 8, "common")
    none = power.power(gate, power.same_pairs(blocks, 8), power.scaled, "lever_arm", 1.0, 0)
    assert none["share"] == 0.0
