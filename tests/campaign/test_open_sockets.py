"""Who can reach a campaign while it runs: nobody from outside this machine."""

import ipaddress
import os
import re
import shlex
import sys

import psutil
import pytest
from campaigns import ROOT, fake_slurm, processes, wait_until

from pipeline.campaign.cluster import client
from pipeline.config.load import load


def addresses(process):
    """Addresses that a process and its children take connections on."""
    family = (process, *process.children(recursive=True))
    found = [c for p in family for c in p.net_connections("inet")]
    return {c.laddr.ip for c in found if c.status == psutil.CONN_LISTEN}


def assert_loopback(found):
    assert found
    assert [a for a in found if not ipaddress.ip_address(a).is_loopback] == []


@pytest.mark.parametrize("kind", ["threads", "processes"])
def test_a_campaign_listens_on_loopback_only(kind):
    with client(load([f"cluster={kind}"]).cluster):
        assert_loopback(addresses(psutil.Process()))


def test_jobs_listen_on_loopback_only(tmp_path, monkeypatch):
    pytest.importorskip("dask_jobqueue")
    tools = tmp_path / "tools"
    fake_slurm(tools)
    monkeypatch.setenv("PATH", f"{tools}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.chdir(tmp_path)
    own = ["cluster=slurm", "cluster.workers=1", "cluster.cores=1", "cluster.memory=2GB"]
    with client(load(own).cluster):
        jobs = [p for p in psutil.process_iter() if str(tools) in " ".join(p.cmdline())]
        assert jobs
        for job in jobs:
            assert_loopback(addresses(job))
        assert_loopback(addresses(psutil.Process()))


def test_a_scheduler_and_a_worker_by_the_manual_listen_where_they_are_told(tmp_path):
    page = (ROOT / "docs/how-to/cluster.md").read_text()
    lines = [line for line in page.splitlines() if line.startswith(("dask scheduler", "dask work"))]
    local = re.sub(r"10\.0\.0\.[56]", "127.0.0.1", "\n".join(lines))
    scheduler, worker = (shlex.split(line)[1:] for line in local.splitlines())
    file = tmp_path / "scheduler.json"
    place = worker.index("tcp://127.0.0.1:8786")
    dask, found = [sys.executable, "-m", "dask"], ["--scheduler-file", str(file)]
    with (
        open(tmp_path / "log", "w") as log,
        processes(
            [*dask, *scheduler, "--port", "0", *found],
            [*dask, *worker[:place], *found, *worker[place + 1 :]],
            stdout=log,
            stderr=log,
            cwd=tmp_path,
        ) as started,
    ):
        wait_until(file.exists)
        wait_until(lambda: "Registered to" in (tmp_path / "log").read_text())
        for process in started:
            assert_loopback(addresses(psutil.Process(process.pid)))
