"""One run of a campaign alone, with its course over time."""

import json

import numpy as np
import xarray as xr
from campaigns import SHORT, error_lines, run_stage

from inscal.parameters import COUNT, NAMES, UNITS
from pipeline import simulate
from pipeline.campaign import store
from pipeline.campaign.course import history_dataset
from pipeline.config.load import load
from pipeline.config.setup import Setup


def test_only_run_repeats_a_run_of_the_campaign(tmp_path, short_store):
    file = tmp_path / "run.nc"
    ended = run_stage(simulate, *SHORT, "only_run=17", f"out={file}")
    assert ended.code == 0
    assert ended.out == f"run 17 of seed 20260101: course in {file}\n"
    assert [*tmp_path.iterdir()] == [file]
    campaign = store.read(short_store).sel(run=17)
    with xr.open_dataset(file, engine="scipy") as course:
        assert course.final_estimate.values.tobytes() == campaign.estimate.values.tobytes()
        assert course.final_error.values.tobytes() == campaign.error.values.tobytes()
        assert course.truth.values.tobytes() == campaign.truth.values.tobytes()
        assert course.nees.values.tobytes() == campaign.nees.values.tobytes()


def test_only_run_goes_beside_the_store_by_default(tmp_path):
    path = tmp_path / "runs" / "campaign"
    assert run_stage(simulate, *SHORT, "only_run=2", f"campaign.store={path}").code == 0
    assert [*path.parent.iterdir()] == [path.parent / "campaign-run2.nc"]


def test_only_run_where_nothing_can_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    ended = run_stage(simulate, *SHORT, "only_run=2", f"out={tmp_path / 'file' / 'run.nc'}")
    assert ended.code == 2
    assert len(error_lines(ended.err)) == 1
    assert "run.nc: cannot be written" in ended.err


def test_course_of_a_run_has_every_pass_and_units():
    config = load([*SHORT, "only_run=17"])
    course = history_dataset(config)
    assert course.sizes == {
        "calibration_pass": 2,
        "time": 160,
        "parameter": COUNT,
        "observation": 6,
    }
    assert course.calibration_pass.values.tolist() == [1, 2]
    assert course.time.values.tolist() == list(range(1, 161))
    assert course.time.attrs["units"] == "s"
    assert course.parameter.values.tolist() == list(NAMES)
    assert course.unit.values.tolist() == list(UNITS)
    assert course.observation_unit.values.tolist() == ["m/s"] * 3 + ["m"] * 3
    for variable in course.data_vars.values():
        assert variable.attrs["units"]
        assert np.isfinite(variable).all()
    assert json.loads(course.attrs["configuration"])["estimator"]["passes"] == 2
    assert (course.attrs["run"], course.attrs["seed"], course.attrs["positions"]) == (
        *(17, 20260101, 4),
    )
    np.testing.assert_array_equal(course.error, course.estimate - course.truth)
    # the predicted sigma of the first pass ends at that of the store
    std = Setup(config).experiment.estimator.predicted_std / Setup(config).unit
    np.testing.assert_array_equal(course.predicted_std.sel(calibration_pass=1)[-1], std)
    # the first pass ends where its own campaign would; the second goes on from there
    one = history_dataset(load([*SHORT, "only_run=17", "estimator=one_pass"]))
    first = course.estimate.sel(calibration_pass=1)
    np.testing.assert_array_equal(first[-1], one.final_estimate)
    assert (course.final_estimate != one.final_estimate).all()
