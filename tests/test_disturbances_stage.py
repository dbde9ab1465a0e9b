"""Stage `disturbances`: campaigns with each disturbance alone."""

import dataclasses
import json

import numpy as np
import pytest
from campaigns import SHORT, run_stage

from inscal.statistics import nominal_coverage
from pipeline import disturbances
from pipeline.campaign import store
from pipeline.config.load import disturbances as keys_of
from pipeline.config.load import load, resolved
from pipeline.config.setup import Setup
from pipeline.study.budget import sheet
from pipeline.study.disturbances import plans
from pipeline.study.findings import ENOUGH

TWO = ("disturbance.accel_drift_ug=30", "disturbance.gyro_wander_deg_per_h=0.01")
TIME = "disturbance.gyro_wander_time_s=50"


def test_each_disturbance_is_alone_once_and_paired(tmp_path):
    out = tmp_path / "found.json"
    ended = run_stage(
        disturbances, *SHORT, *TWO, TIME, f"campaign.store={tmp_path / 'runs'}", f"out={out}"
    )
    assert ended.code == 0, ended.err
    found = json.loads(out.read_text())
    rows = {row["name"]: row for row in found["campaigns"]}
    assert list(rows) == ["none", "gyro_wander_deg_per_h", "accel_drift_ug", "all"]
    stores = {name: store.read(tmp_path / "runs" / name) for name in rows}
    present = {name: keys_of(one.attrs["configuration"]) for name, one in stores.items()}
    assert present["none"] == []
    assert present["accel_drift_ug"] == ["accel_drift_ug"]
    assert present["all"] == ["gyro_wander_deg_per_h", "accel_drift_ug"]
    for name, one in stores.items():
        assert one.truth.values.tobytes() == stores["none"].truth.values.tobytes()
        assert rows[name]["nees"] == pytest.approx(float(one.nees.mean()))
    assert rows["none"]["expected_nees"] == pytest.approx(rows["none"]["modelled"])
    assert rows["all"]["nees"] > 2.0 * rows["none"]["nees"]
    page = out.with_suffix(".md").read_text()
    assert page.count("| `accel_drift_ug` | 30 |") == 1
    # what is made already is not made again
    before = {name: one.stat().st_mtime_ns for name in rows for one in [tmp_path / "runs" / name]}
    run_stage(disturbances, *SHORT, *TWO, TIME, f"campaign.store={tmp_path / 'runs'}", f"out={out}")
    assert before == {name: (tmp_path / "runs" / name).stat().st_mtime_ns for name in rows}


@pytest.mark.parametrize("key", ["accel_drift_ug=2", "gyro_noise_factor=1.2", "gravity_mgal=1"])
def test_growth_is_the_budget_s_for_the_worst_parameter(key):
    config = load([*SHORT, f"disturbance.{key}", "growth=1.5"])
    _, alone, _ = plans(config)
    made = sheet(Setup(alone.config))
    modelled = made.formal_std > 0.0
    ratio = (made.true_std / np.where(modelled, made.formal_std, 1.0))[modelled]
    assert ratio.max() == pytest.approx(1.5, rel=1e-9)
    usual = plans(dataclasses.replace(config, growth=None))[1]
    assert resolved(usual.config)["disturbance"] != resolved(alone.config)["disturbance"]


def test_grown_to_the_bounds_one_is_kept_in_just_enough_runs():
    config = load([*SHORT, "disturbance.accel_drift_ug=2", "growth=bounds"])
    _, alone, _ = plans(config)
    made = sheet(Setup(alone.config))
    kept = np.array([nominal_coverage(x) for x in made.bound / made.true_std])
    without = np.array([nominal_coverage(x) for x in made.bound / made.alone().true_std])
    assert kept[without > ENOUGH].min() == pytest.approx(ENOUGH, rel=1e-9)


def test_a_disturbance_that_fails_every_run_is_told(tmp_path):
    """Vibration far beyond what a calibration stands."""
    out = tmp_path / "found.json"
    ended = run_stage(
        disturbances, *SHORT, "disturbance.vibration_ug=1e9", "disturbance.vibration_hz=3",
        "campaign.max_failed_share=1", f"campaign.store={tmp_path / 'runs'}", f"out={out}",
    )  # fmt: skip
    assert ended.code == 0, ended.err
    alone = json.loads(out.read_text())["campaigns"][1]
    assert (alone["runs_done"], alone["runs_failed"] > 0) == (0, True)
    page = out.with_suffix(".md").read_text()
    assert f"`vibration_ug` ({alone['runs_failed']} of {alone['runs_failed']} runs)." in page
    assert "0 %: every run fails" in page


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "disturbance = none: has no disturbance; choose one that has"),
        ([*TWO, TIME, "growth=1"], "growth = 1: must be null, bounds, or a finite number > 1"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    ended = run_stage(disturbances, *SHORT, *arguments)
    assert ended.code == 2
    assert said in ended.err
    assert not list(tmp_path.iterdir())
