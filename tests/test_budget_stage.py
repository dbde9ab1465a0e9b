"""Stage `budget`: its tables and its file."""

import json

import numpy as np
import pandas as pd
import pytest
from campaigns import run_stage

from inscal.parameters import NAMES, UNITS
from pipeline import budget, predict
from pipeline.config.load import load
from pipeline.config.setup import Setup
from pipeline.study.budget import MOST, checkpoints, sheet

PATH = ("schedule.position_duration_s=60", "simulation.turn_step_s=0.2")


def test_the_file_has_variances_by_source(tmp_path):
    out, predicted = tmp_path / "budget.json", tmp_path / "predicted.json"
    ended = run_stage(budget, *PATH, "disturbance=laboratory", f"out={out}")
    assert ended.code == 0, ended.err
    found = json.loads(out.read_text())
    assert (found["parameter"], found["unit"]) == (list(NAMES), list(UNITS))
    variance = np.array(found["variance"])
    assert variance.shape == (len(found["source"]), 27)
    np.testing.assert_allclose(np.sqrt(variance.sum(axis=0)), found["true_std"], rtol=1e-9)
    run_stage(predict, *PATH, f"out={predicted}")
    claimed = json.loads(predicted.read_text())["predicted_std"]
    np.testing.assert_allclose(found["formal_std"], claimed, rtol=1e-9)
    assert found["expected_nees"] > 100.0
    assert f"expected NEES: {found['expected_nees']:.1f}" in ended.out
    assert "table_offset_mm" in ended.out


def test_without_disturbances_the_filter_is_right(tmp_path):
    ended = run_stage(budget, *PATH)
    assert (ended.code, "expected NEES: 27.0" in ended.out) == (0, True)
    assert "sigma to" not in ended.out


def test_at_its_tolerance_a_disturbance_has_the_effect_that_it_may_have():
    made = sheet(Setup(load([*PATH, "disturbance.table_offset_mm=3"])))
    size, name = made.tolerance("table_offset")["sigma"]
    place = NAMES.index(name)
    again = sheet(Setup(load([*PATH, f"disturbance.table_offset_mm={size}"])))
    ratio = again.true_std / again.formal_std
    assert ratio[place] == pytest.approx(MOST, rel=1e-6)
    assert ratio.max() == pytest.approx(MOST, rel=1e-6)


def test_tables_and_page_beside_the_file_are_the_budget(tmp_path):
    out = tmp_path / "mine.json"
    sizes = "disturbance.gravity_mgal=2", "disturbance.table_offset_mm=3"
    assert run_stage(budget, *PATH, *sizes, f"out={out}").code == 0
    found = json.loads(out.read_text())
    made = sheet(Setup(load([*PATH, *sizes])))
    shares = pd.read_csv(tmp_path / "mine.csv")
    np.testing.assert_allclose(shares.groupby("parameter").share.sum(), 1.0, rtol=1e-4)
    largest = shares[(shares["rank"] == 1) & (shares.parameter == "lever_arm_z")]
    at = np.array(found["variance"])[:, NAMES.index("lever_arm_z")]
    assert largest.source.item() == found["source"][int(at.argmax())]
    assert largest.variance.item() == pytest.approx(at.max(), rel=1e-5)
    effects = pd.read_csv(tmp_path / "mine_sensitivity.csv")
    for source, (key, size) in made.size.items():
        own = effects[effects.key == key].pivot(index="component", columns="parameter")["effect"]
        variance = np.square(size * own[list(NAMES)]).sum()
        np.testing.assert_allclose(variance, made.variance[source], rtol=1e-4, atol=1e-12)
    # more gravity than believed is a scale factor of all accelerometers: 1 mGal is 1.02 ppm of g
    gravity = effects[(effects.key == "gravity_mgal")].set_index("parameter").effect
    for name in ("accel_k11", "accel_k22", "accel_k33"):
        assert abs(gravity[name]) == pytest.approx(1.02, abs=0.02)
    allowed = pd.read_csv(tmp_path / "mine_tolerances.csv").set_index("key")
    sigma, _ = made.tolerance("gravity")["sigma"]
    assert allowed.sigma["gravity_mgal"] == pytest.approx(sigma, rel=1e-4)
    page = (tmp_path / "mine.md").read_text()
    assert "| `table_offset_mm` | `lever_arm_" in page
    for ending in ("", "_mosaic", "_time"):
        assert (tmp_path / f"mine{ending}.png").stat().st_size > 10_000
    # and so no filter tells it from them
    hiding = pd.read_csv(tmp_path / "mine_traces.csv").set_index("key")
    assert hiding.hides["gravity_mgal"]
    assert not hiding.hides["table_offset_mm"].any()
    hidden = page.split("## What hides")[1]
    (row,) = [line for line in hidden.split("\n") if line.startswith("| `gravity_mgal` |")]
    assert row.count("`accel_k") == 3


def test_the_budget_over_time_ends_where_the_budget_is():
    config = load([*PATH, "disturbance.table_offset_mm=3", "disturbance.accel_noise_factor=1.2"])
    found, place = sheet(Setup(config)), NAMES.index("lever_arm_y")
    updates = checkpoints(config)
    assert (len(updates), updates[0], updates[-1]) == (50, 30, 1500)
    course = found.course(place, updates)
    assert list(course) == list(found.variance)
    for source, variance in course.items():
        assert variance[-1] == pytest.approx(found.variance[source][place], rel=1e-6, abs=1e-12)
    total = sum(course.values())
    assert total[0] > 100.0 * total[-1]
    assert found.most_disturbed == int(np.argmax(found.true_std / found.formal_std))


def test_a_parameter_that_there_is_none_of_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ended = run_stage(budget, *PATH, "parameter=lever_arm", "out=x.json")
    assert (ended.code, "parameter = 'lever_arm': must be one of" in ended.err) == (2, True)
    assert not list(tmp_path.iterdir())


def test_budgets_are_written_as_json(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ended = run_stage(budget, *PATH, "out=budget.csv")
    assert (ended.code, "must be a file whose name ends with .json" in ended.err) == (2, True)
    assert not list(tmp_path.iterdir())
