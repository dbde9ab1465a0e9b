"""A campaign with a disturbance, from its configuration to what is read of it."""

import json
import shutil

import numpy as np
import pytest
import xarray as xr
from campaigns import SHORT, assert_same_store, error_lines, make, make_older, run_stage, short

from pipeline import compare, simulate, summarize
from pipeline.campaign import driver, store
from pipeline.campaign.judged import summary_of
from pipeline.config.load import load, resolved, run_settings

ABOUT = "disturbance=laboratory"


@pytest.fixture(scope="module")
def disturbed(tmp_path_factory):
    return make(tmp_path_factory.mktemp("disturbed") / "campaign", ABOUT)


def test_it_is_paired_with_an_undisturbed_one(disturbed, short_store, tmp_path):
    a, b = store.read(disturbed), store.read(short_store)
    assert a.truth.values.tobytes() == b.truth.values.tobytes()
    assert a.attrs["fingerprint"] != b.attrs["fingerprint"]
    assert (a.estimate != b.estimate).all()
    # to be compared they need no more than that
    ended = run_stage(compare, f"a={disturbed}", f"b={short_store}", f"out={tmp_path / 'c.csv'}")
    assert (ended.code, ended.err) == (0, "")
    assert "30 paired runs" in ended.out
    # what runs share cancels: of unpaired ones errors are not correlated
    errors = [x.error.sel(parameter="gyro_bias_x").values for x in (a, b)]
    assert np.corrcoef(*errors)[0, 1] > 0.5


@pytest.mark.parametrize("overrides", [["campaign.batch=7"], ["campaign.batch=1"]], ids=str)
def test_it_is_the_same_whatever_the_batch(disturbed, tmp_path, overrides):
    assert_same_store(disturbed, make(tmp_path / "campaign", ABOUT, *overrides))


def test_it_is_resumed(disturbed, tmp_path, monkeypatch):
    path, looks = tmp_path / "campaign", []

    def stop(*arguments):
        looks.append(arguments)
        if len(looks) == 2:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(driver.CampaignProgress, "advance", stop)
        with pytest.raises(SystemExit):
            make(path, ABOUT, "campaign.batch=8")
    assert (store.read(path).status == store.NOT_RUN).any()
    assert_same_store(disturbed, make(path, ABOUT))


def test_one_run_of_it_is_repeated_alone(disturbed, tmp_path):
    file = tmp_path / "run.nc"
    assert run_stage(simulate, *SHORT, ABOUT, "only_run=17", f"out={file}").code == 0
    campaign = store.read(disturbed).sel(run=17)
    with xr.open_dataset(file, engine="scipy") as course:
        assert course.final_estimate.values.tobytes() == campaign.estimate.values.tobytes()


def test_another_disturbance_is_another_campaign(disturbed):
    ended = run_stage(
        simulate, *SHORT, ABOUT, "disturbance.gravity_mgal=3", f"campaign.store={disturbed}"
    )
    assert ended.code == 2
    assert "holds a campaign of another configuration" in error_lines(ended.err)[0]


def test_a_summary_says_that_truth_is_disturbed(disturbed, short_store, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said = "sources; truth of a bias that wanders is its constant part"
    assert said in " ".join(run_stage(summarize, f"campaign.store={disturbed}").out.split())
    about = json.loads((tmp_path / "results/summary/campaign.json").read_text())
    assert about["disturbance"] == "laboratory"
    assert {"accel_wander_ug", "gyro_noise_factor"} <= set(about["disturbances"])
    assert said not in run_stage(summarize, f"campaign.store={short_store}").out
    # a size of its own is one as well, though its group is called none
    own = make(tmp_path / "own", "disturbance.accel_drift_ug=3")
    assert summary_of(short(own), own).attrs["disturbances"] == ["accel_drift_ug"]


def test_a_store_older_than_disturbances_is_undisturbed(short_store, tmp_path):
    old = tmp_path / "old"
    shutil.copytree(short_store, old)
    make_older(old, "disturbance")
    configuration = store.read(old).attrs["configuration"]
    assert run_settings(configuration) == run_settings(resolved(load(SHORT)))
