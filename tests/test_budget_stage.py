"""Stage `budget`: its tables and its file."""

import json

import numpy as np
import pytest
from campaigns import run_stage

from inscal.parameters import NAMES, UNITS
from pipeline import budget, predict
from pipeline.config.load import load
from pipeline.config.setup import Setup
from pipeline.study.budget import MOST, sheet

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
