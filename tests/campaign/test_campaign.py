"""Small campaigns from end to end: one result whatever computes it, and none lost on the way."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import numpy as np
import pytest
import xarray as xr
import zarr
from campaigns import SHORT, assert_same_store, error_lines, files, make, run_stage, short
from distributed import LocalCluster, get_client

from inscal.kernel import LANES
from inscal.parameters import COUNT, NAMES, UNITS
from pipeline import simulate
from pipeline.campaign import cluster, driver, store, worker
from pipeline.campaign.course import history_dataset
from pipeline.config.load import load
from pipeline.config.setup import Setup
from pipeline.console import progress
from pipeline.console.errors import DataError

DIVERGING = "truth.accel_quadratic_1e_9=4000"
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
def reference(tmp_path_factory):
    """Store of 30 runs, made by the default cluster in one batch."""
    return make(tmp_path_factory.mktemp("reference") / "campaign")


@pytest.fixture(scope="module")
def diverging(tmp_path_factory):
    """Stderr and store of a campaign of which some runs diverge."""
    path = tmp_path_factory.mktemp("diverging") / "campaign"
    return path, run_stage(simulate, *SHORT, DIVERGING, f"campaign.store={path}")


def wait_until(condition, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.02)


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
def test_the_same_bits_whatever_computes_them(tmp_path, reference, overrides):
    assert_same_store(make(tmp_path / "campaign", *overrides), reference)


def test_reference_is_complete_and_random(reference):
    # or the comparisons of bits would compare nothing
    dataset = store.read(reference)
    assert (dataset.status == store.DONE).all()
    for name in ("truth", "estimate", "error", "nees"):
        assert np.isfinite(dataset[name]).all()
        flat = dataset[name].values.ravel()
        assert len(np.unique(flat)) == flat.size


def test_a_seed_is_another_campaign(tmp_path, reference):
    other = store.read(make(tmp_path / "campaign", "campaign.seed=1"))
    assert (other.truth != store.read(reference).truth).all()


def test_a_campaign_is_the_head_of_a_longer_one(tmp_path, reference):
    longer = store.read(make(tmp_path / "campaign", "campaign.runs=41", "campaign.batch=25"))
    for name in ("truth", "estimate", "error", "nees"):
        head = longer[name][:30].values
        assert head.tobytes() == store.read(reference)[name].values.tobytes()


def batches(pending, largest, threads):
    return list(driver.batches(np.array(pending, dtype=int), largest, lambda: threads))


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


# clusters elsewhere


@contextmanager
def processes(*commands, **options):
    """Run commands while the block lasts."""
    started = [subprocess.Popen(command, **options) for command in commands]
    try:
        yield started
    finally:
        for process in started:
            process.kill()
        for process in started:
            process.wait(30)


def test_the_same_bits_from_a_scheduler_and_its_workers(tmp_path, reference):
    dask, address = [sys.executable, "-m", "dask"], tmp_path / "scheduler.json"
    found = ["--scheduler-file", str(address)]
    host = [*found, "--host", "127.0.0.1", "--no-dashboard"]
    small = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(tmp_path)]
    with (
        open(tmp_path / "log", "w") as log,
        processes(
            [*dask, "scheduler", *host, "--port", "0"],
            *2 * [[*dask, "worker", *found, *small]],
            stdout=log,
            stderr=log,
        ),
    ):
        wait_until(address.exists)
        where = json.loads(address.read_text())["address"]
        overrides = ["cluster=scheduler", f"cluster.address={where}", "campaign.batch=2"]
        config = short(tmp_path / "campaign", *overrides)
        with cluster.client(config.cluster) as workers:
            workers.wait_for_workers(2, timeout=60)
        driver.simulate_campaign(config)
        with cluster.client(config.cluster) as workers:
            # still there: a scheduler that others started is not ours to end
            assert len(workers.nthreads()) == 2
    assert_same_store(tmp_path / "campaign", reference)


def test_no_scheduler(tmp_path, monkeypatch):
    monkeypatch.setitem(cluster._SETTINGS, "distributed.comm.timeouts.connect", "500ms")
    path = tmp_path / "campaign"
    address = "tcp://127.0.0.1:1"
    overrides = [*SHORT, "cluster=scheduler", f"cluster.address={address}"]
    start = time.monotonic()
    ended = run_stage(simulate, *overrides, f"campaign.store={path}")
    assert ended.code == 2
    assert error_lines(ended) == [f"error: cluster.address = {address}: no scheduler answers"]
    assert time.monotonic() - start < 20


def test_patience_with_a_scheduler_is_seconds():
    # what the tests here shorten
    assert cluster._SETTINGS["distributed.comm.timeouts.connect"] == "10s"
    assert cluster._WORKER_TIMEOUT_S <= 30


def test_a_scheduler_without_workers(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "_WORKER_TIMEOUT_S", 0.2)
    empty = LocalCluster(
        n_workers=0, processes=False, protocol="tcp", host="127.0.0.1", dashboard_address=None
    )
    with empty:
        config = short(
            tmp_path / "campaign",
            "cluster=scheduler",
            f"cluster.address={empty.scheduler_address}",
        )
        with pytest.raises(DataError, match=r"tcp://.*: the scheduler has no workers"):
            driver.simulate_campaign(config)


def test_tls_without_certificates(tmp_path):
    config = short(
        tmp_path / "campaign", "cluster=scheduler", "cluster.address=tls://127.0.0.1:8786"
    )
    with pytest.raises(DataError, match="tls needs certificates"):
        driver.simulate_campaign(config)


def test_a_killed_worker_process_costs_no_run(tmp_path):
    path = tmp_path / "campaign"
    config = short(
        path, "campaign.runs=400", "campaign.batch=2", "cluster=processes", "cluster.workers=1"
    )
    advance = progress.CampaignProgress.advance
    killed = []

    def advance_and_kill(self, runs):
        advance(self, runs)
        if not killed:
            killed.extend(get_client().run(os.getpid).values())
            os.kill(killed[0], signal.SIGKILL)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(progress.CampaignProgress, "advance", advance_and_kill)
        driver.simulate_campaign(config)
    assert len(killed) == 1
    assert_same_store(path, make(tmp_path / "undisturbed", "campaign.runs=400"))


# SLURM


def test_slurm_needs_dask_jobqueue(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "dask_jobqueue.slurm", None)
    path = tmp_path / "campaign"
    ended = run_stage(simulate, *SHORT, "cluster=slurm", f"campaign.store={path}")
    assert ended.code == 2
    assert error_lines(ended) == [
        "error: cluster = slurm: needs dask-jobqueue, pip install -e '.[slurm]'"
    ]
    assert not path.exists()


def test_without_sbatch_the_job_script_is_printed(tmp_path, monkeypatch):
    pytest.importorskip("dask_jobqueue")
    monkeypatch.setenv("PATH", str(tmp_path))
    overrides = ["cluster=slurm", "cluster.account=physics", "cluster.memory='16 GiB'"]
    ended = run_stage(simulate, *SHORT, *overrides, f"campaign.store={tmp_path / 'campaign'}")
    assert ended.code == 2
    assert error_lines(ended) == [
        "error: cluster = slurm: no sbatch on this machine; "
        "the job script it would submit is on standard output"
    ]
    script = ended.out.splitlines()
    assert script[0].startswith("#!")
    asked = {line.removeprefix("#SBATCH ") for line in script if line.startswith("#SBATCH")}
    assert asked >= {
        *("-p compute", "-A physics", "-n 1", "--cpus-per-task=4", "--mem=16G", "-t 02:00:00")
    }
    command = script[-1]
    # the python of this environment, which has the project, connecting to this scheduler
    assert re.match(
        rf"{re.escape(sys.executable)} -m distributed\.cli\.dask_worker tcp://", command
    )
    assert "--nthreads 4 " in command
    assert "--memory-limit 16.00GiB" in command
    assert [*tmp_path.iterdir()] == []


def test_no_account_is_asked_for_where_none_is_given():
    pytest.importorskip("dask_jobqueue")
    with cluster.slurm(load(["cluster=slurm"]).cluster) as jobs:
        assert "-A" not in jobs.job_script().split()


def test_slurm_jobs_make_the_same_bits(tmp_path, monkeypatch, reference):
    pytest.importorskip("dask_jobqueue")
    tools = tmp_path / "tools"
    tools.mkdir()
    # a SLURM of one machine: a job is a process group of its own, its number the leader's
    log = tmp_path / "job.log"
    copy = f'cp "$1" {tools}/script'  # dask-jobqueue deletes its own
    sbatch = f'{copy}; setsid bash {tools}/script >{log} 2>&1 & echo "Submitted batch job $!"'
    sbatch = sbatch.replace("; ", "\n")
    for name, line in {"sbatch": sbatch, "scancel": 'kill -- "-$1"'}.items():
        (tools / name).write_text(f"#!/bin/bash\n{line}\n")
        (tools / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tools}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.chdir(tmp_path)
    fan_out, threads = driver._fan_out, []

    def spy(*arguments):
        threads.extend(arguments[4].nthreads().values())
        fan_out(*arguments)

    monkeypatch.setattr(driver, "_fan_out", spy)
    make("campaign", "cluster=slurm", "cluster.workers=1", "cluster.cores=1", "campaign.batch=7")
    assert_same_store("campaign", reference)
    assert "distributed.worker" in log.read_text()
    # it waited for the job, and only then started the clock
    assert threads == [1]


# one run alone


def test_only_run_repeats_a_run_of_the_campaign(tmp_path, reference):
    file = tmp_path / "run.nc"
    ended = run_stage(simulate, *SHORT, "only_run=17", f"out={file}")
    assert ended.code == 0
    assert ended.out == f"run 17 of seed 20260101: course in {file}\n"
    assert [*tmp_path.iterdir()] == [file]
    campaign = store.read(reference).sel(run=17)
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
    assert len(error_lines(ended)) == 1
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
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == f"campaign: resuming after {done} of 2500 runs"
    assert lines[-1].startswith("campaign: 2500 of 2500 runs, ")
    assert (store.read(path).status == store.DONE).all()
    assert_same_store(path, make(tmp_path / "uninterrupted", runs))


def test_nothing_is_left_to_do_in_a_finished_campaign(reference, monkeypatch, capsys):
    before = files(reference)
    made.clear()
    monkeypatch.setattr(worker, "run", recording_run)
    monkeypatch.setattr(driver, "client", lambda *_: pytest.fail("started a cluster"))
    make(reference)
    assert made == []
    assert files(reference) == before
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
    assert store.precision(opened, runs) < 0.1 <= store.precision(opened, before)
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
    named = [line for line in error_lines(ended) if "failed" in line]
    assert named == [
        f"campaign: run {run} failed (seed 20260101); repeat with only_run={run}" for run in failed
    ]
    assert error_lines(ended)[-1].startswith("campaign: 30 of 30 runs, ")


@pytest.mark.parametrize("batch", [1, 7])
def test_diverging_runs_do_not_touch_their_neighbours(tmp_path, diverging, batch):
    # in batches of one, all runs of a batch fail
    path = make(tmp_path / "campaign", DIVERGING, f"campaign.batch={batch}")
    assert_same_store(path, diverging[0])


def test_a_diverging_run_can_be_repeated_alone(tmp_path, diverging):
    dataset = store.read(diverging[0])
    run = int(dataset.run[dataset.status == store.FAILED][0])
    file = tmp_path / "run.nc"
    assert run_stage(simulate, *SHORT, DIVERGING, f"only_run={run}", f"out={file}").code == 0
    with xr.open_dataset(file, engine="scipy") as course:
        assert np.isnan(course.final_estimate).all()
        # the course says when
        assert np.isfinite(course.estimate[0, 0]).all()


@pytest.mark.parametrize("batch", [7, 64])
def test_an_exception_in_a_run_costs_this_run_only(tmp_path, monkeypatch, reference, batch):
    monkeypatch.setattr(worker, "run", breaking_run)
    path = tmp_path / "campaign"
    ended = run_stage(simulate, *SHORT, f"campaign.batch={batch}", f"campaign.store={path}")
    assert ended.code == 0
    assert f"run {BROKEN} failed (seed 20260101); repeat with only_run={BROKEN}" in ended.err
    dataset, whole = store.read(path), store.read(reference)
    assert dataset.run[dataset.status != store.DONE].values.tolist() == [BROKEN]
    assert dataset.status.sel(run=BROKEN) == store.FAILED
    assert np.isnan(dataset.estimate.sel(run=BROKEN)).all()
    others = dataset.run != BROKEN
    for name in ("truth", "estimate", "error", "nees"):
        assert dataset[name][others].values.tobytes() == whole[name][others].values.tobytes()


# progress


def test_plain_output_is_one_line(tmp_path):
    ended = run_stage(simulate, *SHORT, f"campaign.store={tmp_path / 'campaign'}")
    assert (ended.code, ended.out) == (0, "")
    (line,) = error_lines(ended)
    assert re.fullmatch(r"campaign: 30 of 30 runs, \d+\.\d s, \d+ runs/s", line)


def test_resumed_output_is_two_lines(tmp_path):
    config = short(tmp_path / "campaign")
    opened = store.open_store(config, np.ones(COUNT))
    store.write(opened, config, [([0, 1, 2], worker.attempt(Setup(config).experiment, [0, 1, 2]))])
    ended = run_stage(simulate, *SHORT, f"campaign.store={tmp_path / 'campaign'}")
    first, last = error_lines(ended)
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


def test_store_in_the_way_ends_the_stage_with_exit_code_2(tmp_path, reference):
    before = files(reference)
    ended = run_stage(simulate, *SHORT, "campaign.seed=3", f"campaign.store={reference}")
    assert ended.code == 2
    (line,) = error_lines(ended)
    assert line.startswith(f"error: campaign.store = {reference}: holds a campaign of another")
    assert files(reference) == before
