"""Stages predict, summarize and compare: what they write, where, and how they refuse."""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from campaigns import LIMIT, ROOT, SHORT, error_lines, make, run_stage, short

from inscal.parameters import INDEX, NAMES, UNITS
from pipeline import compare, predict, summarize
from pipeline.campaign import store
from pipeline.campaign.worker import attempt
from pipeline.config.load import load
from pipeline.config.schema import KIND_KEYS
from pipeline.config.setup import Setup
from pipeline.console import output
from pipeline.console.errors import DataError

REFERENCE = {
    "gyro_bias": [3.55e-4, 3.73e-4, 4.23e-4],
    "gyro_k": [0.222, 0.223, 0.126, 0.223, 0.132, 0.286],
    "accel_bias": [0.293, 0.290, 0.370],
    "accel_k": [0.0928, 0.0870, 0.116, 0.170, 0.0928, 0.0797, 0.105, 0.0991, 0.0649],
    "accel_quadratic": [0.0188, 0.0186, 0.0229],
    "lever_arm": [0.300, 0.300, 0.310],
}
"""Predicted sigma of the reference case in paper units, from an independent filter."""

ONCE = "schedule.rotations=[[180,Y],[90,Y],[180,Y],[90,Y],[-90,X]]"
"""Shows every axis up, level and down, but for y, which is never up."""


@pytest.fixture(autouse=True)
def cwd(tmp_path, monkeypatch):
    """An empty working directory: whatever a stage leaves there is seen."""
    folder = tmp_path / "cwd"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture(scope="module")
def campaigns(tmp_path_factory):
    """A folder of small finished campaigns."""
    folder = tmp_path_factory.mktemp("campaigns")
    make(folder / "two_pass")
    make(folder / "one_pass", "estimator=one_pass")
    make(folder / "classic", "estimator=states30")
    make(folder / "other_seed", "campaign.seed=1")
    make(folder / "other_truth", "truth=uniform")
    make(folder / "other_unit", "sensor.quadratic_unit=si")
    make(folder / "diverging", "truth.accel_quadratic_1e_9=4000", "campaign.max_failed_share=1")
    return folder


def left_in(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def table_of(path):
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    numbers = {name for name in rows[0] if name not in ("parameter", "unit")}
    columns = {name: np.array([float(row[name] or "nan") for row in rows]) for name in numbers}
    return [row["parameter"] for row in rows], [row["unit"] for row in rows], columns


# predict


def test_predict_writes_its_contract_and_nothing_else(cwd):
    ended = run_stage(predict, "out=deep/predicted.json")
    assert (ended.code, ended.err) == (0, "")
    assert left_in(cwd) == ["deep/predicted.json"]
    predicted = json.loads((cwd / "deep/predicted.json").read_text())
    assert list(predicted) == [
        *("parameter", "unit", "predicted_std", "bound"),
        *("joint_share", "joint_share_asked", "worst", "noise_factor", "time_factor"),
    ]
    assert predicted["parameter"] == list(NAMES)
    assert predicted["unit"] == list(UNITS)
    std = np.array(predicted["predicted_std"])
    for group, expected in REFERENCE.items():
        np.testing.assert_allclose(std[INDEX[group]], expected, rtol=0.05)
    # the table says the same
    for name, unit, sigma in zip(NAMES, UNITS, std, strict=True):
        (row,) = [line for line in ended.out.splitlines() if f" {name} " in line]
        assert unit in row
        assert f"{sigma:.4g}" in row


def test_predict_agrees_with_what_a_campaign_stores(campaigns):
    run_stage(predict, *SHORT, "out=predicted.json")
    predicted = json.loads(Path("predicted.json").read_text())["predicted_std"]
    np.testing.assert_array_equal(predicted, store.read(campaigns / "two_pass").predicted_std)


def test_predict_without_out_writes_nothing(cwd):
    ended = run_stage(predict, *SHORT)
    assert ended.code == 0
    assert "gyro_bias_x" in ended.out
    assert left_in(cwd) == []


def test_predict_shows_what_is_not_modelled():
    ended = run_stage(predict, *SHORT, "estimator.states=[gyro_bias]")
    rows = [line for line in ended.out.splitlines() if "lever_arm" in line]
    assert len(rows) == 3
    assert all("not modelled" in row for row in rows)
    assert ended.out.count("not modelled") == 24


def test_predict_warns_of_a_pair_the_path_cannot_separate():
    ended = run_stage(predict, ONCE)
    assert ended.code == 0
    assert ended.err == (
        "warning: schedule.rotations never shows +y up: "
        "accel_k22 and accel_quadratic_y cannot be told apart\n"
    )
    assert "warning" not in ended.out


def test_predict_where_nothing_can_be_written(cwd):
    (cwd / "file").write_text("")
    ended = run_stage(predict, *SHORT, "out=file/predicted.json")
    assert ended.code == 2
    (line,) = error_lines(ended.err)
    assert line.startswith("error: file/predicted.json: cannot be written (")


# summarize


def test_summarize_writes_csv_and_json_and_nothing_else(cwd, campaigns):
    ended = run_stage(summarize, f"campaign.store={campaigns / 'two_pass'}")
    assert (ended.code, ended.err) == (0, "")
    assert left_in(cwd) == ["results/summary/two_pass.csv", "results/summary/two_pass.json"]
    with open("results/summary/two_pass.csv") as file:
        header = file.readline().strip().split(",")
    assert header[:2] == ["parameter", "unit"]
    assert set(header) == {
        *("parameter", "unit", "bias", "bias_mcse", "std", "std_mcse"),
        *("rmse", "rmse_lower", "rmse_upper", "abs_error_p95", "abs_error_p997"),
        *("predicted_std", "rmse_over_predicted"),
        *("model_error_percent", "model_error_percent_mcse"),
        *("coverage_1_sigma", "coverage_1_sigma_lower", "coverage_1_sigma_upper"),
        *("coverage_2_sigma", "coverage_2_sigma_lower", "coverage_2_sigma_upper"),
        *("coverage_3_sigma", "coverage_3_sigma_lower", "coverage_3_sigma_upper"),
        *("bias_eliminated_coverage", "bias_eliminated_coverage_mcse"),
        *("bound", "share_within_bound", "share_within_bound_lower", "share_within_bound_upper"),
    }
    content = json.loads(Path("results/summary/two_pass.json").read_text())
    assert set(content) == {
        *("confidence", "campaign", "seed", "passes", "truth", "schedule", "noise"),
        *("quadratic_unit", "failed_runs", "runs_done", "runs_failed", "precision"),
        *("sha256", "store", "joint_share_asked", "each_share_asked"),
        "least_precise",
        *("passes_taken", "failures", "runs_contradicted"),
        *("joint_share", "joint_share_lower", "joint_share_upper"),
        *("nees_mean", "nees_lower", "nees_upper", "parameters"),
    }
    assert list(content["parameters"]) == list(NAMES)
    assert set(content["parameters"]["accel_k22"]) == set(header) - {"parameter"}


def test_summary_agrees_with_the_store(campaigns):
    run_stage(summarize, f"campaign.store={campaigns / 'two_pass'}")
    names, units, table = table_of("results/summary/two_pass.csv")
    content = json.loads(Path("results/summary/two_pass.json").read_text())
    dataset = store.read(campaigns / "two_pass")
    error, sigma = dataset.error.values, dataset.predicted_std.values
    bound = Setup(load([])).bound
    expected = {
        "bias": error.mean(0),
        "std": error.std(0, ddof=1),
        "rmse": np.sqrt((error**2).mean(0)),
        "rmse_over_predicted": np.sqrt((error**2).mean(0)) / sigma,
        "predicted_std": sigma,
        "bound": bound,
        "share_within_bound": (abs(error) <= bound).mean(0),
        **{f"coverage_{k}_sigma": (abs(error) <= k * sigma).mean(0) for k in (1, 2, 3)},
    }
    assert names == list(NAMES)
    assert units == list(UNITS)
    for key, values in expected.items():
        np.testing.assert_allclose(table[key], values, rtol=1e-5, atol=1e-12)
        stored = [content["parameters"][name][key] for name in NAMES]
        np.testing.assert_allclose(stored, values, rtol=1e-12, atol=1e-15)
    assert content["nees_mean"] == pytest.approx(dataset.nees.values.mean(), rel=1e-12)
    assert content["nees_lower"] < 27 < content["nees_upper"]
    assert (content["runs_done"], content["runs_failed"], content["failed_runs"]) == (30, 0, [])
    assert (content["campaign"], content["seed"], content["passes"]) == ("two_pass", 20260101, 2)
    assert (content["truth"], content["schedule"]) == ("normal", "position25")
    assert content["noise"]["name"] == "reference"


def test_summarize_judges_by_the_bounds_it_is_given(campaigns):
    path = f"campaign.store={campaigns / 'two_pass'}"
    dataset = store.read(campaigns / "two_pass")
    wide = [f"bounds.{key}=1e6" for key in KIND_KEYS.values() if key != "lever_arm_mm"]
    run_stage(summarize, path, *wide, "bounds.lever_arm_mm=[3,4,5]")
    _, _, table = table_of("results/summary/two_pass.csv")
    arm = INDEX["lever_arm"]
    within = abs(dataset.error[:, arm]) <= [3, 4, 5]
    np.testing.assert_array_equal(table["bound"][arm], [3, 4, 5])
    np.testing.assert_allclose(table["share_within_bound"][arm], within.mean("run"), rtol=1e-5)
    joint = json.loads(Path("results/summary/two_pass.json").read_text())["joint_share"]
    assert joint == within.all("parameter").mean()
    assert 0 < joint < within.mean("run").min() < 1


def test_summarize_counts_failed_runs(campaigns):
    ended = run_stage(summarize, f"campaign.store={campaigns / 'diverging'}")
    assert ended.code == 1
    dataset = store.read(campaigns / "diverging")
    failed = dataset.run[dataset.status == store.FAILED].values.tolist()
    assert 0 < len(failed) < 30
    content = json.loads(Path("results/summary/diverging.json").read_text())
    assert content["runs_failed"] == len(failed)
    assert content["failed_runs"] == failed
    assert content["runs_done"] == 30 - len(failed)
    assert content["failures"].keys() == {str(run) for run in failed}
    assert sum(content["passes_taken"].values()) == 30 - len(failed)
    share = f"{100 * len(failed) / 30:.1f} %"
    assert f"{len(failed)} runs ({share}) did not converge and miss every bound" in " ".join(
        ended.out.split()
    )
    assert f"of {30 - len(failed)} runs that converged, consistent if in" in ended.out


def test_summarize_an_unfinished_campaign_says_so(tmp_path):
    config = short(tmp_path / "campaign")
    opened = store.open_store(
        config, Setup(config).experiment.estimator.predicted_std / Setup(config).unit
    )
    empty = run_stage(summarize, f"campaign.store={tmp_path / 'campaign'}")
    assert empty.code == 2
    assert empty.err.startswith(f"error: campaign store {tmp_path / 'campaign'}: no run")
    assert empty.err.count("\n") == 1
    runs = list(range(12))
    store.write(opened, config, [(runs, attempt(Setup(config).experiment, runs, LIMIT))])
    ended = run_stage(summarize, f"campaign.store={tmp_path / 'campaign'}")
    assert ended.code == 0
    assert ended.err == f"note: {tmp_path / 'campaign'}: 18 of 30 runs are not made\n"
    assert json.loads(Path("results/summary/campaign.json").read_text())["runs_done"] == 12


def test_summarize_without_a_store(cwd):
    ended = run_stage(summarize, "campaign.store=nowhere")
    assert ended.code == 2
    assert ended.out == ""
    assert ended.err == (
        "error: campaign store nowhere: not found; make it with pipeline.simulate\n"
    )
    assert left_in(cwd) == []


def test_summarize_what_is_no_store(cwd):
    (cwd / "notes").mkdir()
    ended = run_stage(summarize, "campaign.store=notes")
    assert ended.code == 2
    assert ended.err.count("\n") == 1
    assert "notes: exists and is not a campaign store" in ended.err


# compare


def paths(campaigns, a, b):
    return [f"a={campaigns / a}", f"b={campaigns / b}"]


def test_compare_two_campaigns_of_one_seed(cwd, campaigns):
    ended = run_stage(compare, *paths(campaigns, "one_pass", "two_pass"))
    assert (ended.code, ended.err) == (0, "")
    base = "results/comparison/one_pass-over-two_pass"
    assert left_in(cwd) == [f"{base}.csv", f"{base}.json", f"{base}.md"]
    names, _, table = table_of(f"{base}.csv")
    content = json.loads(Path(f"{base}.json").read_text())
    a, b = (store.read(campaigns / name) for name in ("one_pass", "two_pass"))
    ratio = np.sqrt((a.error**2).mean("run") / (b.error**2).mean("run")).values
    assert abs(ratio - 1).max() > 0.05  # or any ratio would do
    assert names == list(NAMES)
    np.testing.assert_allclose(table["ratio"], ratio, rtol=1e-5)
    np.testing.assert_allclose(table["rmse_a"] / table["rmse_b"], ratio, rtol=1e-5)
    np.testing.assert_array_equal(table["predicted_ratio"], np.ones(27))
    rows = content["parameters"].values()
    np.testing.assert_allclose([row["ratio"] for row in rows], ratio, rtol=1e-12)
    assert (table["simultaneous_lower"] <= table["lower"] + 1e-6).all()
    assert (table["lower"] <= table["ratio"]).all()
    assert (table["ratio"] <= table["upper"]).all()
    assert (table["lower"] < table["upper"]).mean() > 0.5  # some the short path never shows
    assert (table["upper"] <= table["simultaneous_upper"] + 1e-6).all()
    assert content["runs_paired"] == 30
    assert (content["a"], content["b"], content["seed"]) == ("one_pass", "two_pass", 20260101)
    assert content["duration_s"] == [160.0, 160.0]
    for name, value in zip(NAMES, ratio, strict=True):
        (row,) = [line for line in ended.out.splitlines() if f" {name} " in line]
        assert f"{value:.3f}" in row


def test_compare_writes_where_out_says(cwd, campaigns):
    ended = run_stage(compare, *paths(campaigns, "one_pass", "two_pass"), "out=deep/ratio.csv")
    assert ended.code == 0
    assert left_in(cwd) == ["deep/ratio.csv", "deep/ratio.json", "deep/ratio.md"]
    assert Path("deep/ratio.csv").read_text().startswith("parameter,unit,")
    json.loads(Path("deep/ratio.json").read_text())


def test_compare_does_not_write_its_json_over_its_csv(cwd, campaigns):
    ended = run_stage(compare, *paths(campaigns, "one_pass", "two_pass"), "out=ratio.json")
    assert ended.code == 2
    assert "out = 'ratio.json': must be a file whose name ends with .csv" in ended.err
    assert left_in(cwd) == []


def test_compare_pairs_the_runs_done_in_both(campaigns, tmp_path):
    # as the same campaign, but some runs of one of the two are missing
    config = short(tmp_path / "part", "estimator=one_pass")
    opened = store.open_store(config, np.ones(27))
    runs = list(range(5, 20))
    store.write(opened, config, [(runs, attempt(Setup(config).experiment, runs, LIMIT))])
    result = compare.comparison_of(tmp_path / "part", campaigns / "two_pass")
    assert result.runs_paired == 15
    a, b = (store.read(campaigns / name).error[5:20] for name in ("one_pass", "two_pass"))
    ratio = np.sqrt((a**2).mean("run") / (b**2).mean("run"))
    np.testing.assert_allclose(result.ratio, ratio, rtol=1e-12)


def test_compare_a_filter_that_models_less(campaigns):
    ended = run_stage(compare, *paths(campaigns, "classic", "two_pass"))
    assert ended.code == 0
    _, _, table = table_of("results/comparison/classic-over-two_pass.csv")
    unmodelled = np.isnan(table["predicted_ratio"])
    assert [name for name, missing in zip(NAMES, unmodelled, strict=True) if missing] == [
        *(f"accel_quadratic_{axis}" for axis in "xyz"),
        *(f"lever_arm_{axis}" for axis in "xyz"),
    ]
    a, b = (store.read(campaigns / name).predicted_std for name in ("classic", "two_pass"))
    np.testing.assert_allclose(table["predicted_ratio"][~unmodelled], (a / b)[~unmodelled], 1e-5)
    assert np.isfinite(table["ratio"]).all()


@pytest.mark.parametrize(
    ("a", "b", "said"),
    [
        ("two_pass", "other_seed", "seeds (20260101, 1) differ, so their runs are no pairs"),
        ("two_pass", "other_truth", "run 0 has another truth in each campaign"),
        ("two_pass", "other_unit", "other units: sensor.quadratic_unit = pulse -> si"),
        ("two_pass", "nowhere", "nowhere: not found; make it with pipeline.simulate"),
        ("nowhere", "two_pass", "nowhere: not found; make it with pipeline.simulate"),
    ],
)
def test_compare_refuses_in_one_line(cwd, campaigns, a, b, said):
    ended = run_stage(compare, *paths(campaigns, a, b))
    assert ended.code == 2
    assert ended.out == ""
    assert ended.err.startswith("error: ")
    assert said in ended.err
    assert ended.err.count("\n") == 1
    assert left_in(cwd) == []


@pytest.mark.parametrize("missing", ["a", "b"])
def test_compare_needs_both(campaigns, missing):
    given = {"a": "b", "b": "a"}[missing]
    ended = run_stage(compare, f"{given}={campaigns / 'two_pass'}")
    assert ended.code == 2
    assert ended.err == f"error: {missing} = null: must be the path of a campaign store\n"


# files and command lines


def test_text_is_written_with_its_folder_or_refused_in_one_line(tmp_path):
    output.write_text(tmp_path / "a" / "b.txt", "text")
    assert (tmp_path / "a" / "b.txt").read_text() == "text"
    with pytest.raises(DataError, match=r"b\.txt/c: cannot be written \("):
        output.write_text(tmp_path / "a" / "b.txt" / "c", "text")


@pytest.mark.parametrize(
    ("arguments", "code", "left"),
    [
        (
            ["simulate", "campaign.store=runs/x", "cluster=processes"],
            0,
            ["runs"],
        ),
        (["summarize"], 2, []),
    ],
    ids=["simulate", "summarize"],
)
def test_command_line_leaves_nothing_but_what_it_names(cwd, arguments, code, left):
    name, *overrides = arguments
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", f"pipeline.{name}", *SHORT, *overrides]
    ended = subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True)
    assert ended.returncode == code, ended.stderr
    assert "Traceback" not in ended.stderr
    assert sorted(path.name for path in cwd.iterdir()) == left
    assert sorted(path.name for path in cwd.glob("runs/*")) == (["x", "x.log.json"] if left else [])
