"""Campaigns of filters with augmented states: stores, summaries, single runs, old stores."""

import json

import numpy as np
import pytest
import xarray as xr
from campaigns import SHORT, assert_same_store, make, make_older, run_stage, short

from inscal.parameters import AUGMENTATIONS
from pipeline import predict, simulate, summarize
from pipeline.campaign import judged, store
from pipeline.campaign.course import history_dataset
from pipeline.config.disturbance import key_of, unit_text
from pipeline.config.load import load, resolved, unknown
from pipeline.config.setup import Setup

ARMS = (
    "estimator=states43",
    "disturbance.off_axis_lever_arm_mm=20",
    "disturbance.gyro_accel_delay_ms=1",
)
NAMES = [*AUGMENTATIONS["off_axis_lever_arm"].names, "gyro_accel_delay"]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return make(tmp_path_factory.mktemp("augmented") / "runs", *ARMS)


def test_a_store_holds_augmented_states_by_name(made):
    campaign = store.read(made)
    assert campaign.augmented.values.tolist() == NAMES
    assert campaign.augmented_unit.values.tolist() == ["mm"] * 6 + ["ms"]
    error = campaign.augmented_estimate - campaign.augmented_truth
    np.testing.assert_array_equal(error, campaign.augmented_error)
    drawn = campaign.augmented_truth.std("run")
    assert drawn.sel(augmented="lever_arm_xy") == pytest.approx(20.0, rel=0.5)
    assert drawn.sel(augmented="gyro_accel_delay") == pytest.approx(1.0, rel=0.5)
    sigma = campaign.augmented_predicted_std
    assert (0.0 < sigma).all() and (sigma <= [20.0] * 6 + [1.0]).all()  # noqa: PT018
    assert float((error / sigma).std()) == pytest.approx(1.0, abs=0.25)


def test_it_is_the_same_in_pieces(made, tmp_path):
    assert_same_store(made, make(tmp_path / "runs", *ARMS, "campaign.batch=7"))


def test_a_summary_and_its_table_have_them(made, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ended = run_stage(summarize, f"campaign.store={made}", "campaign.max_failed_share=1")
    assert ended.code == 0, ended.err
    found = json.loads((tmp_path / "results/summary/runs.json").read_text())
    assert list(found["augmented"]) == NAMES
    row = found["augmented"]["gyro_accel_delay"]
    error = store.read(made).augmented_error.sel(augmented="gyro_accel_delay")
    assert row["rmse"] == pytest.approx(float(np.sqrt(np.square(error).mean())))
    assert row["unit"] == "ms"
    assert row["rmse_over_predicted"] == pytest.approx(row["rmse"] / row["predicted_std"])
    assert "lever_arm_zy" in ended.out
    assert len(found["parameters"]) == 27


def test_one_run_again_has_them(made, tmp_path):
    config = short(made, *ARMS, "only_run=4")
    course, campaign = history_dataset(config), store.read(made).isel(run=4)
    for name in ("augmented_truth", "augmented_estimate", "augmented_predicted_std"):
        np.testing.assert_array_equal(course[name], campaign[name])
    ended = run_stage(simulate, *SHORT, *ARMS, "only_run=4", f"out={tmp_path / 'run.nc'}")
    assert ended.code == 0, ended.err
    again = xr.load_dataset(tmp_path / "run.nc")
    assert [str(name) for name in again.augmented.values] == NAMES


def test_plain_stores_have_none_and_older_ones_are_read(tmp_path):
    path = make(tmp_path / "runs")
    assert not [name for name in store.read(path).variables if "augmented" in str(name)]
    assert "augmented" not in judged.summary_of(load([]), path).attrs
    make_older(path, "estimator", "believed")
    read = store.read(path).attrs["configuration"]
    assert read["estimator"]["believed"] == resolved(load([]))["estimator"]["believed"]


def test_what_a_filter_believes_in_just_that_size_is_not_unknown():
    full = resolved(load([*ARMS, "disturbance.gravity_mgal=1", "disturbance.table_offset_mm=2"]))
    assert unknown(full) == ["table_offset_mm", "gravity_mgal"]
    other = resolved(load([*ARMS, "estimator.believed.gyro_accel_delay_ms=2"]))
    assert unknown(other) == ["gyro_accel_delay_ms"]
    louder = ["disturbance.gyro_noise_factor=1.2", "estimator.believed.gyro_noise_factor=1.2"]
    assert unknown(resolved(load(louder))) == []
    assert unknown(resolved(load(louder[:1]))) == ["gyro_noise_factor"]


def test_every_group_has_a_prior_key_and_a_unit():
    believed = load([]).estimator.believed
    for group in AUGMENTATIONS.values():
        assert getattr(believed, key_of(group.source)) > 0.0
    assert unit_text(key_of("accel_cubic")) == "ug/g^3"
    assert unit_text(key_of("gyro_g_sensitivity")) == "deg/h/g"
    setup = Setup(load(["estimator=robust"]))
    assert len(setup.augmented_names) == len(setup.augmented_unit) == setup.model.states - 42
    assert setup.model.states == 72


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ["estimator.states=[gyro_bias,accel_bias,magnetometer]"],
            "estimator.states = ['gyro_bias', 'accel_bias', 'magnetometer']: must be one or",
        ),
        (["estimator.states=[table_offset]"], "estimator.states = ['table_offset']: must be"),
        (
            ["estimator=states43", "estimator.believed.gyro_accel_delay_ms=0"],
            "estimator.believed.gyro_accel_delay_ms = 0.0: must be > 0 where estimator.states has",
        ),
        (
            ["estimator=robust", "estimator.believed.accel_wander_time_s=0"],
            "estimator.believed.accel_wander_time_s = 0.0: must be > 0 where estimator.states has",
        ),
        (
            ["estimator.believed.gyro_noise_factor=0"],
            "estimator.believed.gyro_noise_factor = 0.0: must be a finite number > 0",
        ),
    ],
)
def test_what_cannot_be_believed_is_refused(arguments, said):
    ended = run_stage(predict, *SHORT, *arguments)
    assert ended.code == 2
    assert said in ended.err
