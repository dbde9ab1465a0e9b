"""The gate: its files, what it says on the command line, and the study of its power."""

import json
import shutil
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import planted
import pytest
from campaigns import run_stage
from normal_samples import normal_errors

from inscal import regression
from pipeline import regress
from pipeline.config.load import differences, load
from pipeline.console.errors import DataError
from pipeline.gate import baseline, history, judge, power
from pipeline.gate.cases import reference as reference_case


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(judge, "BASELINE", tmp_path / "baseline")
    return tmp_path / "baseline"


@pytest.fixture
def kept(folder, clean_cases):
    """The baselines of this code on disk."""
    for case, sample in clean_cases:
        place = baseline.folder_of(folder, case.name)
        baseline.write_baseline(place, sample, case.configuration, "of this test")
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
    assert ended.out == "identical: 1408 runs of 11 cases against the baseline: of this test\n"


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


def test_the_gate_tells_people_pull_requests_and_machines(kept, tmp_path):
    out = tmp_path / "told" / "gate.json"
    ended = run_stage(regress, "estimator=one_pass", f"out={out}", f"baseline={kept}")
    assert ended.code == 1
    found = json.loads(out.read_text())
    assert found["verdict"] == "worse"
    first, *others = found["cases"]
    assert (first["name"], first["verdict"]) == ("reference", "worse")
    assert {case["verdict"] for case in others} == {"identical"}
    ratios = [loss["ratio"] for loss in first["losses"]]
    assert ratios == sorted(ratios, reverse=True)
    shown = [line for line in ended.out.splitlines() if ": RMSE " in line]
    assert shown[0].strip().startswith(f"{first['losses'][0]['name']}: RMSE")
    suite = ElementTree.parse(out.with_suffix(".xml")).getroot()
    assert (suite.get("tests"), suite.get("failures")) == ("11", "1")
    (failure,) = suite.iter("failure")
    assert "RMSE" in failure.text
    page = out.with_suffix(".md").read_text()
    assert page.startswith("## Accuracy gate: worse\n")
    assert f"`{first['losses'][0]['name']}`" in page
    missing = run_stage(regress, f"baseline={tmp_path / 'nothing'}")
    assert missing.code == 2


def written(folder):
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def test_accepting_writes_a_baseline_with_its_reason(folder, clean):
    ended = run_stage(regress, "accept='a finer filter'")
    assert (ended.code, ended.err) == (0, "")
    assert json.loads((folder / "baseline.json").read_text())["reason"] == "a finer filter"
    first = written(folder)
    run_stage(regress, "accept='a finer filter'")
    second = written(folder)
    once, twice = (files.pop(history.FILE).splitlines() for files in (first, second))
    assert second == first
    assert twice == [*once, once[-1]]
    assert len(first) == 3 * 11
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
    monkeypatch.setattr(judge, "cases", lambda config: [reference_case(config)])
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
@pytest.mark.parametrize("case", ["reference", "few_positions"])
def test_a_baseline_that_cannot_be_read_is_one_line(kept, harm, case):
    harm(baseline.folder_of(kept, case))
    ended = run_stage(regress)
    assert (ended.code, ended.out) == (2, "")
    assert ended.err.startswith("error: ")
    assert "baseline" in ended.err
    assert ended.err.count("\n") == 1


def test_differences_name_the_key_and_both_values(reference):
    old = baseline.configuration_of(reference)
    new = baseline.configuration_of(load(["noise=quiet", "campaign.batch=7", "campaign.seed=4"]))
    lines = differences(old, new)
    assert "noise.position_observation_m = 0.1 -> 0.05" in lines
    assert "seed = 20260101 -> 4" in lines
    assert {line.split(".")[0].split(" ")[0] for line in lines} == {"noise", "seed"}
    assert differences(old, old) == []


def test_this_code_passes_the_committed_baselines(reference):
    judged = list(judge.judgements(reference))
    assert len(judged) == 11
    for case, judgement, about in judged:
        assert judgement.same_data, case.name
        assert judgement.verdict in ("identical", "changed, no worse"), case.name
        assert about["configuration"] == case.configuration


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
