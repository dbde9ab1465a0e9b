"""Campaigns on clusters: the same bits from a scheduler, SLURM and processes that die."""

import json
import os
import re
import signal
import sys
import time

import pytest
from campaigns import (
    SHORT,
    assert_same_store,
    error_lines,
    fake_slurm,
    make,
    processes,
    run_stage,
    short,
    wait_until,
)
from distributed import LocalCluster, get_client

from pipeline import simulate
from pipeline.campaign import cluster, driver
from pipeline.config.load import load
from pipeline.console import progress
from pipeline.console.errors import DataError

# clusters elsewhere


def test_the_same_bits_from_a_scheduler_and_its_workers(tmp_path, short_store):
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
    assert_same_store(tmp_path / "campaign", short_store)


def test_no_scheduler(tmp_path, monkeypatch):
    monkeypatch.setitem(cluster._SETTINGS, "distributed.comm.timeouts.connect", "500ms")
    path = tmp_path / "campaign"
    address = "tcp://127.0.0.1:1"
    overrides = [*SHORT, "cluster=scheduler", f"cluster.address={address}"]
    start = time.monotonic()
    ended = run_stage(simulate, *overrides, f"campaign.store={path}")
    assert ended.code == 2
    assert error_lines(ended.err) == [f"error: cluster.address = {address}: no scheduler answers"]
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
    assert error_lines(ended.err) == [
        "error: cluster = slurm: needs dask-jobqueue, pip install -e '.[slurm]'"
    ]
    assert not path.exists()


def test_without_sbatch_the_job_script_is_printed(tmp_path, monkeypatch):
    pytest.importorskip("dask_jobqueue")
    monkeypatch.setenv("PATH", str(tmp_path))
    overrides = ["cluster=slurm", "cluster.account=physics", "cluster.memory='16 GiB'"]
    ended = run_stage(simulate, *SHORT, *overrides, f"campaign.store={tmp_path / 'campaign'}")
    assert ended.code == 2
    assert error_lines(ended.err) == [
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


@pytest.mark.parametrize("address", [None, "tcp://127.0.0.2:18786"])
def test_jobs_are_waited_for_on_this_machine_unless_an_address_is_asked_for(address):
    pytest.importorskip("dask_jobqueue")
    asked = ["cluster=slurm", f"cluster.address={address or 'null'}"]
    with cluster.slurm(load(asked).cluster) as jobs:
        assert jobs.scheduler_address.startswith(address or "tcp://127.0.0.1:")
        words = jobs.job_script().split()
    assert jobs.scheduler_address in words
    assert ("--host" in words) == (address is None)


def test_no_account_is_asked_for_where_none_is_given():
    pytest.importorskip("dask_jobqueue")
    with cluster.slurm(load(["cluster=slurm"]).cluster) as jobs:
        assert "-A" not in jobs.job_script().split()


def test_slurm_jobs_make_the_same_bits(tmp_path, monkeypatch, short_store):
    pytest.importorskip("dask_jobqueue")
    tools = tmp_path / "tools"
    fake_slurm(tools)
    monkeypatch.setenv("PATH", f"{tools}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.chdir(tmp_path)
    fan_out, threads = driver.fan_out, []

    def spy(*arguments):
        threads.extend(arguments[4].nthreads().values())
        fan_out(*arguments)

    monkeypatch.setattr(driver, "fan_out", spy)
    make("campaign", "cluster=slurm", "cluster.workers=1", "cluster.cores=1", "campaign.batch=7")
    assert_same_store("campaign", short_store)
    (log,) = tools.glob("*.log")
    assert "distributed.worker" in log.read_text()
    # it waited for the job, and only then started the clock
    assert threads == [1]
