"""Campaign stores: layout, size in files, resumption, and what is never overwritten."""

import json
import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
import zarr
from campaigns import assert_same_store, files, make, make_older, short

from inscal.experiment import Outcome
from inscal.parameters import COUNT, NAMES, UNITS
from pipeline.campaign import store
from pipeline.campaign.worker import Batch
from pipeline.config.load import resolved
from pipeline.config.setup import Setup
from pipeline.console.errors import DataError

STD = np.linspace(0.1, 0.2, COUNT)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "campaign"


def outcome(runs, failed=()):
    """Made-up results that depend on the run number alone, as the real ones do."""
    numbers = np.asarray(runs, dtype=float)
    truth = np.sin(numbers[:, None] + np.arange(COUNT))
    estimate = truth + 0.01 * np.cos(numbers[:, None] * np.arange(COUNT))
    bad = np.isin(runs, failed)
    estimate[bad] = np.nan
    passes, reason = np.full(len(bad), 2), bad.astype(np.int8)
    nees, ratio = np.where(bad, np.nan, numbers + 0.5), np.where(bad, np.nan, 1.0)
    further = np.empty((len(bad), 0))
    return Outcome(truth, estimate, further, further, nees, bad, passes, reason, ratio)


def batch(runs, failed=()):
    return list(runs), Batch(outcome(runs, failed), {})


def tree(folder):
    return {file: file.read_bytes() for file in folder.rglob("*") if file.is_file()}


# layout


def test_template(path):
    config = short(path)
    store.open_store(config, STD)
    dataset = store.read(path)
    layout = {name: (v.dims, v.dtype.name) for name, v in dataset.data_vars.items()}
    per_run = ("run", "parameter")
    assert layout == {
        "truth": (per_run, "float64"),
        "estimate": (per_run, "float64"),
        "error": (per_run, "float64"),
        "nees": (("run",), "float64"),
        "status": (("run",), "int8"),
        "passes": (("run",), "int8"),
        "reason": (("run",), "int8"),
        "innovation_ratio": (("run",), "float64"),
        "predicted_std": (("parameter",), "float64"),
    }
    assert dataset.sizes == {"run": 30, "parameter": COUNT}
    assert dataset.run.values.tolist() == list(range(30))
    assert dataset.parameter.values.tolist() == list(NAMES)
    assert dataset.unit.dims == ("parameter",)
    assert dataset.unit.values.tolist() == list(UNITS)
    for name in ("truth", "estimate", "error", "nees"):
        assert np.isnan(dataset[name]).all()
    assert (dataset.status == store.NOT_RUN).all()
    np.testing.assert_array_equal(dataset.predicted_std, STD)
    for name, variable in dataset.data_vars.items():
        assert variable.attrs.get("long_name") or name in ("status", "reason")
        assert variable.attrs.get("units") or name in ("status", "reason")
    assert dataset.status.attrs["flag_meanings"].split() == ["not_run", "done", "failed"]


def test_attributes_say_all_that_made_the_store(path):
    config = short(path, "noise=quiet", "campaign.seed=5", "truth.gyro_bias_deg_per_h=[1,2,3]")
    store.open_store(config, STD)
    attrs = store.read(path).attrs
    assert attrs["configuration"] == json.loads(json.dumps(resolved(config)))
    assert attrs["fingerprint"] == store.fingerprint(config)
    assert attrs["seed"] == 5
    assert attrs["software"].keys() == {
        *("inscal", "numpy", "scipy", "numba", "xarray", "zarr", "dask")
    }
    assert attrs["software"]["zarr"] == zarr.__version__
    assert attrs["title"] == "inscal campaign campaign"


def test_store_is_zarr_3_that_xarray_alone_can_open(path):
    make(path)
    assert json.loads((path / "zarr.json").read_text())["zarr_format"] == 3
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        dataset = xr.open_zarr(path)
    assert (dataset.status == store.DONE).all()


def test_netcdf_takes_what_xarray_opens(path):
    make(path, f"campaign.seed={2**40 + 1}")
    copy = path.with_suffix(".nc")
    xr.open_zarr(path).to_netcdf(copy)
    again = xr.load_dataset(copy)
    assert (again.error == store.read(path).error).all()
    assert int(again.attrs["seed"]) == 2**40 + 1
    assert json.loads(again.attrs["configuration"])["campaign"]["seed"] == 2**40 + 1


@pytest.mark.parametrize("runs", [1, 11, 12, 13, 100_000])
def test_a_store_is_few_files_whatever_its_runs(path, runs):
    opened = store.open_store(short(path, f"campaign.runs={runs}"), STD)
    written = {file.relative_to(path).parts[0] for file in path.rglob("c/**/*") if file.is_file()}
    arrays = dict(opened.arrays())
    # every file there can ever be: the metadata, and each chunk of each array
    chunks = sum(
        math.prod(-(-n // c) for n, c in zip(array.shape, array.chunks, strict=True))
        for array in arrays.values()
    )
    assert len(arrays) + 1 + chunks < 100
    assert len(files(path)) + 1 <= len(arrays) + 1 + chunks
    # the template holds what is not of runs, and zarr leaves out what is all zero: run 0 of 1
    assert written | {"run"} == {"run", "parameter", "unit", "predicted_std"}


def test_a_finished_store_has_the_files_computed(path):
    make(path)
    arrays = dict(zarr.open_group(path, mode="r").arrays())
    chunks = sum(
        math.prod(-(-n // c) for n, c in zip(array.shape, array.chunks, strict=True))
        for array in arrays.values()
    )
    # no run failed: zarr leaves out what is all zero
    assert len(files(path)) == len(arrays) + chunks < 99  # and the manifest


# resumption


def test_pending_after_partial_writes(path):
    config = short(path)
    opened = store.open_store(config, STD)
    assert store.pending(opened).tolist() == list(range(30))
    store.write(opened, config, [batch(range(10, 14)), batch(range(3))])
    left = [*range(3, 10), *range(14, 30)]
    assert store.pending(opened).tolist() == left
    again = store.open_store(config, STD)
    assert store.pending(again).tolist() == left
    # what was written is still there after the template was found again
    np.testing.assert_array_equal(again["nees"][10:14], outcome(range(10, 14)).nees)


def test_failed_runs_are_recorded_and_not_pending(path):
    config = short(path)
    opened = store.open_store(config, STD)
    store.write(opened, config, [batch(range(30), failed=[4, 29])])
    assert store.pending(opened).size == 0
    dataset = store.read(path)
    assert dataset.run[dataset.status == store.FAILED].values.tolist() == [4, 29]
    assert np.isnan(dataset.estimate.sel(run=[4, 29])).all()
    assert np.isfinite(dataset.truth).all()
    assert int((dataset.status == store.DONE).sum()) == 28


def test_values_are_written_in_paper_units(path):
    config = short(path)
    store.write(store.open_store(config, STD), config, [batch(range(30))])
    dataset, expected = store.read(path), outcome(range(30))
    np.testing.assert_array_equal(dataset.truth, expected.truth / Setup(config).unit)
    np.testing.assert_array_equal(dataset.estimate, expected.estimate / Setup(config).unit)
    np.testing.assert_array_equal(dataset.error, dataset.estimate - dataset.truth)
    np.testing.assert_array_equal(dataset.nees, expected.nees)


def test_scattered_batches_equal_one_whole_write(tmp_path):
    whole, parts = short(tmp_path / "whole"), short(tmp_path / "parts")
    store.write(store.open_store(whole, STD), whole, [batch(range(30), failed=[8])])
    opened = store.open_store(parts, STD)
    for group in ([(20, 25), (0, 7), (7, 8), (12, 14)], [(25, 30), (8, 12), (14, 20)]):
        store.write(opened, parts, [batch(range(*ends), failed=[8]) for ends in group])
    assert_same_store(tmp_path / "whole", tmp_path / "parts")


def test_exceptions_of_a_store_of_before_are_kept_when_it_is_gone_on_with(path):
    config = short(path)
    runs, made = batch(range(15), failed=[11])
    store.write(
        store.open_store(config, STD), config, [(runs, replace(made, exceptions={11: "a"}))]
    )
    make_older(path)
    runs, made = batch(range(15, 30), failed=[20])
    store.write(
        store.open_store(config, STD), config, [(runs, replace(made, exceptions={20: "b"}))]
    )
    assert store.read(path).attrs["exceptions"] == {"11": "a", "20": "b"}


def test_neighbours_are_written_together(path, monkeypatch):
    config = short(path)
    opened = store.open_store(config, STD)
    written = []
    set_item = zarr.Array.__setitem__

    def spy(array, part, values):
        written.append((array.basename, part.start, part.stop))
        set_item(array, part, values)

    monkeypatch.setattr(zarr.Array, "__setitem__", spy)
    store.write(opened, config, [batch(range(7, 14)), batch(range(20, 22)), batch(range(7))])
    assert [stretch for stretch in written if stretch[0] == "status"] == [
        ("status", 0, 14),
        ("status", 20, 22),
    ]
    # a run counts as done only after all its numbers are on disk
    assert [name for name, *_ in written] == 2 * [
        *("truth", "estimate", "error", "nees", "passes", "reason", "innovation_ratio", "status")
    ]


def test_leftovers_of_a_killed_write_go_when_the_store_is_opened_again(path):
    config = short(path)
    opened = store.open_store(config, STD)
    store.write(opened, config, [batch(range(5))])
    before = files(path)
    # as zarr names a file until it is whole
    (path / "status" / "c" / "0.0123456789abcdef.partial").write_bytes(b"half")
    store.open_store(config, STD)
    assert files(path) == before


# what is in the way


def test_another_campaign_in_the_way_is_refused_in_one_line_and_kept(path):
    make(path)
    before = tree(path)
    with pytest.raises(DataError) as caught:
        store.open_store(short(path, "campaign.seed=1"), STD)
    line = str(caught.value)
    assert f"campaign.store = {path}: holds a campaign of another configuration" in line
    assert "campaign.replace=true" in line
    assert "\n" not in line
    assert tree(path) == before


def test_replace_makes_a_new_store_in_its_place(path):
    make(path)
    config = short(path, "campaign.seed=1", "campaign.replace=true")
    opened = store.open_store(config, STD)
    assert store.pending(opened).size == 30
    assert store.read(path).attrs["fingerprint"] == store.fingerprint(config)


def test_replace_keeps_a_store_of_the_same_configuration(path):
    make(path)
    before = tree(path)
    opened = store.open_store(short(path, "campaign.replace=true"), STD)
    assert store.pending(opened).size == 0
    assert tree(path) == before


def foreign_folder(path):
    path.mkdir()
    (path / "thesis.txt").write_text("years of work")


def foreign_zarr(path):
    zarr.create_group(path, attributes={"mine": True})


def foreign_json(path):
    path.mkdir()
    (path / "zarr.json").write_text("[]")


def foreign_file(path):
    path.write_text("years of work")


def empty_folder(path):
    path.mkdir()


@pytest.mark.parametrize("replace", ["false", "true"])
@pytest.mark.parametrize(
    "place", [foreign_folder, foreign_zarr, foreign_json, foreign_file, empty_folder]
)
def test_what_is_not_ours_is_never_deleted(path, place, replace):
    place(path)
    before = tree(path.parent)
    with pytest.raises(DataError, match="exists and is not a campaign store") as caught:
        store.open_store(short(path, f"campaign.replace={replace}"), STD)
    assert "\n" not in str(caught.value)
    assert tree(path.parent) == before
    assert path.exists()


def test_a_folder_called_new_beside_the_store_is_not_ours_to_delete(path):
    neighbour = path.with_name(path.name + ".new")
    make(neighbour)
    before = tree(neighbour)
    make(path)
    assert tree(neighbour) == before


def test_crash_while_a_store_is_made_leaves_none_and_is_cleaned_up(path, monkeypatch):
    config = short(path)
    with monkeypatch.context() as patch:
        patch.setattr(store.Path, "rename", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            store.open_store(config, STD)
    assert not path.exists()
    (unfinished,) = path.parent.iterdir()
    (unfinished / "zarr.json").write_text("half")
    (unfinished / "stray").write_text("of another version")
    store.open_store(config, STD)
    assert [*path.parent.iterdir()] == [path]
    assert store.pending(zarr.open_group(path)).size == 30


def test_a_store_where_nothing_can_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match=r"file/campaign: cannot be written \(Not a directory\)"):
        store.open_store(short(tmp_path / "file" / "campaign"), STD)


def test_reading_what_is_no_store(path):
    with pytest.raises(DataError, match=r"campaign: not found; make it with pipeline\.simulate"):
        store.read(path)
    foreign_folder(path)
    with pytest.raises(DataError, match="is not a campaign store"):
        store.read(path)
