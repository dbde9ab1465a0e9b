"""Small campaigns from end to end: one result whatever computes it, and none lost on the way."""

import re
import signal
import sys

import numpy as np
import pytest
import xarray as xr
import zarr
from campaigns import (
    LIMIT,
    SHORT,
    assert_same_store,
    error_lines,
    files,
    make,
    processes,
    run_stage,
    short,
    wait_until,
)

from inscal.convergence import REASONS
from inscal.kernel import LANES
from inscal.parameters import COUNT
from pipeline import simulate, summarize
from pipeline.campaign import driver, fan_out, store, worker
from pipeline.config.setup import Setup
from pipeline.console import progress

DIVERGING = ("truth.accel_quadratic_1e_9=4000", "campaign.max_failed_share=1")
"""So large that in some runs no specific force explains what the sensor reports."""

_run = worker.run
made: list[int] = []
BROKEN = 13


def recording_run(experiment, runs, workspace):
    made.extend(runs)
    return _run(experiment, runs, workspace)


def breaking_run(experiment, runs, workspace):
    if BROKEN in runs:
        raise FloatingPointError("a defect of one run")
    return _run(experiment, runs, workspace)


@pytest.fixture(scope="module")
def diverging(tmp_path_factory):
    """Stderr and store of a campaign of which some runs diverge."""
    path = tmp_path_factory.mktemp("diverging") / "campaign"
    return path, run_stage(simulate, *SHORT, *DIVERGING, f"campaign.store={path}")


# one result whatever computes it


@pytest.mark.parametrize(
    "overrides",
    [
        ["campaign.batch=7"],
        ["campaign.batch=25", "cluster.workers=1"],
        ["campaign.batch=1", "cluster.workers=2"],
        ["campaign.batch=4", "cluster=processes"],
    ],
    ids=" ".join,
)
def test_the_same_bits_whatever_computes_them(tmp_path, short_store, overrides):
    assert_same_store(make(tmp_path / "campaign", *overrides), short_store)


def test_reference_is_complete_and_random(short_store):
    # or the comparisons of bits would compare nothing
    dataset = store.read(short_store)
    assert (dataset.status == store.DONE).all()
    for name in ("truth", "estimate", "error", "nees"):
        assert np.isfinite(dataset[name]).all()
        flat = dataset[name].values.ravel()
        assert len(np.unique(flat)) == flat.size


def test_a_seed_is_another_campaign(tmp_path, short_store):
    other = store.read(make(tmp_path / "campaign", "campaign.seed=1"))
    assert (other.truth != store.read(short_store).truth).all()


def test_a_campaign_is_the_head_of_a_longer_one(tmp_path, short_store):
    longer = store.read(make(tmp_path / "campaign", "campaign.runs=41", "campaign.batch=25"))
    for name in ("truth", "estimate", "error", "nees"):
        head = longer[name][:30].values
        assert head.tobytes() == store.read(short_store)[name].values.tobytes()


def batches(pending, largest, threads):
    return list(fan_out.batches(np.array(pending, dtype=int), largest, lambda: threads))


def test_batches_are_consecutive_and_hold_every_pending_run_once():
    pending = [0, 1, 2, 3, 7, 8, 20]
    assert batches(pending, 3, 1) == [[0, 1, 2], [3], [7, 8], [20]]
    assert batches(pending, 100, 1) == [[0, 1, 2, 3], [7, 8], [20]]
    assert batches([], 3, 1) == []


@pytest.mark.parametrize("threads", [1, 2, 7])
def test_batches_shrink_towards_the_end(threads):
    split = batches(range(2000), 256, threads)
    sizes = [len(batch) for batch in split]
    assert [run for batch in split for run in batch] == list(range(2000))
    assert sizes == sorted(sizes, reverse=True)
    assert max(sizes) <= 256
    assert all(size % LANES == 0 for size in sizes[:-1])
    assert sizes[-1] <= LANES
    assert len(split) >= threads


# interruption


def test_kill_and_resume(tmp_path, monkeypatch, capsys):
    path = tmp_path / "campaign"
    runs = "campaign.runs=2500"
    # one by one, which takes many times the two seconds between writes
    command = [sys.executable, "-m", "pipeline.simulate", *SHORT, runs, "campaign.batch=1"]
    with processes([*command, f"campaign.store={path}"], cwd=tmp_path) as (victim,):

        def some_done():
            assert victim.poll() is None, "ended before it could be killed"
            return (path / "status" / "c").exists()

        wait_until(some_done)
        victim.send_signal(signal.SIGKILL)
        assert victim.wait(30) == -signal.SIGKILL
    status = store.read(path).status
    left = status.run[status == store.NOT_RUN].values.tolist()
    done = 2500 - len(left)
    assert 0 < done < 2500

    made.clear()
    monkeypatch.setattr(worker, "run", recording_run)
    capsys.readouterr()
    make(path, runs)
    assert sorted(made) == left
    lines = error_lines(capsys.readouterr().err)
    assert lines[0] == f"campaign: resuming after {done} of 2500 runs"
    assert lines[-1].startswith("campaign: 2500 of 2500 runs, ")
    assert (store.read(path).status == store.DONE).all()
    assert_same_store(path, make(tmp_path / "uninterrupted", runs))


def test_nothing_is_left_to_do_in_a_finished_campaign(short_store, monkeypatch, capsys):
    before = files(short_store)
    made.clear()
    monkeypatch.setattr(worker, "run", recording_run)
    monkeypatch.setattr(driver, "client", lambda *_: pytest.fail("started a cluster"))
    make(short_store)
    assert made == []
    assert files(short_store) == before
    assert "campaign: resuming after 30 of 30 runs" in capsys.readouterr().err


# enough runs


def test_checkpoints_end_at_the_largest_number():
    for runs in (1, 199, 200, 201, 5000):
        looks = driver.checkpoints(runs)
        assert looks[0] == min(200, runs)
        assert looks[-1] == runs
        assert looks == sorted(set(looks))


def test_precision_stops_at_the_same_run_whatever_the_batch(tmp_path, monkeypatch):
    made.clear()
    monkeypatch.setattr(worker, "run", recording_run)
    wanted = ["campaign.runs=1000", "campaign.precision=0.1"]
    path = make(tmp_path / "a", *wanted, "campaign.batch=64")
    assert sorted(made) == list(range(len(made)))
    assert_same_store(path, make(tmp_path / "b", *wanted, "campaign.batch=7"))
    opened, looks = zarr.open_group(path, mode="r"), driver.checkpoints(1000)
    runs = 1000 - len(store.pending(opened))
    assert store.pending(opened).tolist() == list(range(runs, 1000))
    assert 200 < runs < 1000
    # precise enough here, and not yet at the look before
    before = looks[looks.index(runs) - 1]
    assert store.precision(opened, runs)[0] < 0.1 <= store.precision(opened, before)[0]
    # a campaign that had enough makes no more runs when it is called again
    made.clear()
    make(path, *wanted)
    assert made == []


# runs that fail


def test_diverging_runs_are_recorded_and_named(diverging):
    path, ended = diverging
    dataset = store.read(path)
    failed = dataset.run[dataset.status == store.FAILED].values
    assert 0 < len(failed) < 30
    assert ended.code == 0
    for name in ("estimate", "error", "nees"):
        assert np.isnan(dataset[name].sel(run=failed)).all()
        assert np.isfinite(dataset[name][dataset.status == store.DONE]).all()
    assert np.isfinite(dataset.truth).all()
    for name in ("passes", "reason"):
        assert (dataset[name].sel(run=failed) > 0).all()
    named = [line for line in error_lines(ended.err) if "failed" in line]
    assert named == [
        f"campaign: run {run} failed: {REASONS[dataset.reason.values[run]]} (seed 20260101); "
        f"repeat with only_run={run}"
        for run in failed
    ]
    assert error_lines(ended.err)[-1].startswith("campaign: 30 of 30 runs, ")


@pytest.mark.parametrize("batch", [1, 7])
def test_diverging_runs_do_not_touch_their_neighbours(tmp_path, diverging, batch):
    # in batches of one, all runs of a batch fail
    path = make(tmp_path / "campaign", *DIVERGING, f"campaign.batch={batch}")
    assert_same_store(path, diverging[0])


def test_a_diverging_run_can_be_repeated_alone(tmp_path, diverging):
    dataset = store.read(diverging[0])
    run = int(dataset.run[dataset.status == store.FAILED][0])
    file = tmp_path / "run.nc"
    assert run_stage(simulate, *SHORT, *DIVERGING, f"only_run={run}", f"out={file}").code == 0
    with xr.open_dataset(file, engine="scipy") as course:
        assert np.isnan(course.final_estimate).all()
        # the course says when
        assert np.isfinite(course.estimate[0, 0]).all()


@pytest.mark.parametrize("batch", [7, 64])
def test_an_exception_in_a_run_costs_this_run_only(tmp_path, monkeypatch, short_store, batch):
    monkeypatch.setattr(worker, "run", breaking_run)
    path = tmp_path / "campaign"
    ended = run_stage(simulate, *SHORT, f"campaign.batch={batch}", f"campaign.store={path}")
    assert ended.code == 1  # 1 of 30 is more than a per cent
    why = "FloatingPointError: a defect of one run"
    assert f"run {BROKEN} failed: {why} (seed 20260101); repeat with only_run={BROKEN}" in ended.err
    dataset, whole = store.read(path), store.read(short_store)
    assert dataset.attrs["exceptions"] == {str(BROKEN): why}
    assert dataset.run[dataset.status != store.DONE].values.tolist() == [BROKEN]
    assert dataset.status.sel(run=BROKEN) == store.FAILED
    assert np.isnan(dataset.estimate.sel(run=BROKEN)).all()
    others = dataset.run != BROKEN
    for name in ("truth", "estimate", "error", "nees"):
        assert dataset[name][others].values.tobytes() == whole[name][others].values.tobytes()


@pytest.mark.parametrize(("allowed", "code"), [(None, 1), (0.9999, 0)])
def test_more_failed_runs_than_allowed_end_a_stage_with_exit_code_1(
    tmp_path, monkeypatch, diverging, allowed, code
):
    monkeypatch.chdir(tmp_path)
    path, _ = diverging
    share = [] if allowed is None else [f"campaign.max_failed_share={allowed}"]
    for stage in (simulate, summarize):
        ended = run_stage(stage, *SHORT, DIVERGING[0], f"campaign.store={path}", *share)
        assert ended.code == code
        failed = int((store.read(path).status == store.FAILED).sum())
        line = (
            f"error: {path}: {failed} of 30 runs failed, {100 * failed / 30:.1f} %; "
            "campaign.max_failed_share allows 1 %"
        )
        assert (line in ended.err) == (code == 1)


# progress


def test_plain_output_is_one_line(tmp_path):
    ended = run_stage(simulate, *SHORT, f"campaign.store={tmp_path / 'campaign'}")
    assert (ended.code, ended.out) == (0, "")
    (line,) = error_lines(ended.err)
    assert re.fullmatch(r"campaign: 30 of 30 runs, \d+\.\d s, \d+ runs/s", line)


def test_resumed_output_is_two_lines(tmp_path):
    config = short(tmp_path / "campaign")
    opened = store.open_store(config, np.ones(COUNT))
    store.write(
        opened, config, [([0, 1, 2], worker.attempt(Setup(config).experiment, [0, 1, 2], LIMIT))]
    )
    ended = run_stage(simulate, *SHORT, f"campaign.store={tmp_path / 'campaign'}")
    first, last = error_lines(ended.err)
    assert first == "campaign: resuming after 3 of 30 runs"
    # the rate is that of the runs made now
    done = re.fullmatch(r"campaign: 30 of 30 runs, (\d+\.\d) s, (\d+) runs/s", last)
    assert done is not None


def test_long_campaigns_report_now_and_then(monkeypatch, capsys):
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    with progress.CampaignProgress(1000, 200, "x[/b]") as shown:
        for _ in range(6):
            now[0] += 4.0
            shown.advance(100)
    lines = capsys.readouterr().err.splitlines()
    # every line's rate is of this session, and the time left follows from it
    assert lines == [
        "x[/b]: resuming after 200 of 1000 runs",
        "x[/b]: 500 of 1000 runs, 25 runs/s, 20 s left",
        "x[/b]: 800 of 1000 runs, 25 runs/s, 8 s left",
        "x[/b]: 800 of 1000 runs, 24.0 s, 25 runs/s",
    ]


def test_store_in_the_way_ends_the_stage_with_exit_code_2(tmp_path, short_store):
    before = files(short_store)
    ended = run_stage(simulate, *SHORT, "campaign.seed=3", f"campaign.store={short_store}")
    assert ended.code == 2
    (line,) = error_lines(ended.err)
    assert line.startswith(f"error: campaign.store = {short_store}: holds a campaign of another")
    assert files(short_store) == before
