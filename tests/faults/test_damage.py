"""The short form of the survey of damaged stores; the long one is `damage.py` by itself."""

import json
import shutil

import damage
import pytest
import zarr
from campaigns import SHORT, make, run_stage

from pipeline import summarize
from pipeline.campaign import manifest, store
from pipeline.console.errors import DataError


def test_no_damage_is_unseen_and_all_is_mended_to_the_last_bit():
    found = damage.survey(40, 30, 12)
    assert found == {"refused": 70, "mended": 12}


def test_it_breaks_nothing_outside_its_own_folder(tmp_path):
    (tmp_path / "good").mkdir()
    with pytest.raises(SystemExit, match="not a folder that this program made"):
        damage.copy_of(tmp_path / "good")


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    return make(tmp_path_factory.mktemp("damage") / "good")


def test_a_stage_names_store_array_and_runs(good, tmp_path):
    bad = shutil.copytree(good, tmp_path / "bad")
    (bad / "error/c/3/0").write_bytes(b"x")
    ended = run_stage(summarize, *SHORT, f"campaign.store={bad}", f"out={tmp_path / 's.json'}")
    assert ended.code == 2
    assert "error/c/3/0 is not as it was written (runs 9 to 11)" in ended.err
    assert "pipeline.simulate" in ended.err
    assert len(ended.err.strip().splitlines()) == 1
    assert not (tmp_path / "s.json").exists()


@pytest.mark.parametrize(
    ("array", "value", "said"),
    [
        ("status", 7, "status cannot be right in run 4"),
        ("error", 1.0, "error cannot be right in run 4"),
        ("nees", -1.0, "nees cannot be right in run 4"),
        ("estimate", float("nan"), "estimate cannot be right in run 4"),
        ("passes", 0, "passes cannot be right in run 4"),
    ],
)
def test_numbers_that_contradict_each_other_are_damage(good, tmp_path, array, value, said):
    """Also where every checksum is right."""
    bad = shutil.copytree(good, tmp_path / "bad")
    zarr.open_group(bad, mode="r+")[array][4] = value
    manifest.seal(bad, manifest.read(bad).fingerprint)
    with pytest.raises(DataError, match=said):
        store.read(bad)


def test_a_store_without_manifest_is_read_and_its_chunks_have_checksums(good, tmp_path):
    bad = shutil.copytree(good, tmp_path / "bad")
    (bad / manifest.NAME).unlink()
    assert (store.read(bad)["error"] == store.read(good)["error"]).all()
    chunk = bad / "error/c/3/0"
    content = bytearray(chunk.read_bytes())
    content[20] ^= 1
    chunk.write_bytes(content)
    with pytest.raises(DataError, match="cannot be read"):
        store.read(bad)


def test_a_writer_that_was_killed_is_no_damage(good, tmp_path):
    """Between its two entries in the manifest."""
    half = shutil.copytree(good, tmp_path / "half")
    manifest.begin(half, ["error/c/3/0", "status/c/3"])
    zarr.open_group(half, mode="r+")["status"][9:12] = store.NOT_RUN
    assert int((store.read(half)["status"] == store.DONE).sum()) == 27
    about = json.loads((half / manifest.NAME).read_text())
    assert about["content"]["writing"] == ["error/c/3/0", "status/c/3"]
    assert damage.healed(half, good)
