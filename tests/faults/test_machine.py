"""The short forms of what happens to a campaign's machine; the long ones are the programs here."""

import random
import sys
import threading

import disk
import fuzz
import kills
import numpy as np
import pytest
import runs
from campaigns import SHORT, assert_same_store, make, processes, run_stage, wait_until

from pipeline import simulate
from pipeline.campaign import cluster, fan_out, store, worker
from pipeline.campaign.lock import writing


@pytest.mark.parametrize("kind", ["exit", "machine_code"])
def test_a_run_that_ends_its_process_is_named_and_the_others_are_made(tmp_path, kind, short_store):
    code, said, path = runs.campaign(tmp_path, kind)
    assert runs.judged(code, said, path) == "named"
    found, good = store.read(path), store.read(short_store)
    others = found["run"] != runs.RUN
    assert found["error"][others].values.tobytes() == good["error"][others].values.tobytes()


def test_a_run_that_never_ends_stops_a_campaign_of_threads(tmp_path, monkeypatch):
    """For a thread cannot be ended; in processes the run is found."""
    release = threading.Event()
    monkeypatch.setattr(fan_out, "_LOOK_S", 0.2)
    whole = worker.run

    def hanging(experiment, numbers, workspace):
        if runs.RUN in numbers:
            release.wait(60)
        return whole(experiment, numbers, workspace)

    monkeypatch.setattr(worker, "run", hanging)
    path = tmp_path / "campaign"
    overrides = [*SHORT, f"campaign.store={path}", "campaign.batch=4", "cluster.workers=2"]
    timer = threading.Timer(8.0, release.set)
    timer.start()
    ended = run_stage(simulate, *overrides, "campaign.batch_time_limit_s=2")
    timer.cancel()
    release.set()
    assert ended.code == 2
    assert "take longer than campaign.batch_time_limit_s" in ended.err
    assert int((store.read(path)["status"] == store.DONE).sum()) >= 20
    assert run_stage(simulate, *overrides).code == 0


def test_a_disk_that_becomes_full_costs_nothing_but_time(tmp_path):
    (tmp_path / "faults").mkdir()
    if not disk.is_possible(tmp_path):
        pytest.skip("this system allows no file system of one's own")
    met = disk.campaigns(tmp_path, 3)
    assert {*met} <= {"one line", "whole"}
    assert "one line" in met
    assert disk.summary(tmp_path) == "one line"


@pytest.mark.parametrize("victim", ["group", "interrupted", "starting_worker"])
def test_what_is_killed_goes_on(tmp_path, victim):
    good = make(tmp_path / "good", kills.RUNS)
    assert kills.tried(victim, good, random.Random(7)) == "as it was"


def test_a_store_that_is_taken_away_is_told_in_one_line(tmp_path, monkeypatch, short_store):
    path, whole = tmp_path / "campaign", store.write

    def taken_away(target, config, results):
        if path.exists() and results:
            path.rename(tmp_path / "elsewhere")
        whole(target, config, results)

    monkeypatch.setattr(store, "write", taken_away)
    overrides = [*SHORT, f"campaign.store={path}", "campaign.batch=4"]
    ended = run_stage(simulate, *overrides)
    assert ended.code == 2
    (line,) = [line for line in ended.err.splitlines() if line.startswith("error:")]
    assert "cannot be written any more" in line
    monkeypatch.undo()
    (tmp_path / "elsewhere").rename(path) if not path.exists() else None
    assert run_stage(simulate, *overrides).code == 0
    assert_same_store(path, short_store)


def test_a_scheduler_that_does_not_answer_leaves_everything_as_it_was(tmp_path, monkeypatch):
    monkeypatch.setitem(cluster._SETTINGS, "distributed.comm.timeouts.connect", "1s")
    path = make(tmp_path / "campaign", "noise=quiet")
    before = {file: file.read_bytes() for file in path.rglob("*") if file.is_file()}
    ended = run_stage(
        simulate,
        *(*SHORT, f"campaign.store={path}", "campaign.replace=true"),
        *("cluster=scheduler", "cluster.address=tcp://127.0.0.1:1"),
    )
    assert ended.code == 2
    assert {file: file.read_bytes() for file in path.rglob("*") if file.is_file()} == before
    new = tmp_path / "new"
    run_stage(simulate, *SHORT, f"campaign.store={new}", "cluster=scheduler")
    assert not new.exists()


def test_whatever_is_given_is_told_in_one_line():
    found = fuzz.survey(120, 7)
    assert set(found) == {"accepted", "refused"}
    assert found["refused"] > 60


def test_the_second_writer_is_refused_under_any_name_of_the_store(tmp_path, short_store):
    path, link = make(tmp_path / "campaign"), tmp_path / "link"
    link.symlink_to(path)
    with writing(path):
        for name in (path, link):
            ended = run_stage(simulate, *SHORT, f"campaign.store={name}", "campaign.runs=31")
            assert ended.code == 2
            assert "another process is writing it" in ended.err
    assert_same_store(path, short_store)


def test_a_reader_beside_a_writer_sees_whole_runs_and_no_damage(tmp_path):
    path = tmp_path / "campaign"
    command = [sys.executable, "-m", "pipeline.simulate", *SHORT, "campaign.runs=3000"]
    with processes([*command, "campaign.batch=1", f"campaign.store={path}"]) as (writer,):
        wait_until((path / "zarr.json").exists)
        seen = []
        while writer.poll() is None:
            found = store.done(store.read(path))
            assert np.isfinite(found["error"]).all()
            seen.append(found.sizes["run"])
    assert writer.returncode == 0
    assert seen == sorted(seen)
    assert len(set(seen)) > 1
