"""Signals: what ends, how soon, with which line, and that nothing finished is lost."""

import http.server
import logging
import os
import re
import shlex
import signal
import subprocess
import sys
import threading
import time
import warnings
from dataclasses import replace
from pathlib import Path

import pytest
from campaigns import ROOT, SHORT, assert_same_store, error_lines, make, run_stage, short
from distributed import LocalCluster, get_client

from pipeline import simulate
from pipeline.campaign import cluster, driver, fan_out, store
from pipeline.campaign.lock import writing
from pipeline.campaign.provenance import log_path
from pipeline.config.load import load
from pipeline.console import interrupts

BOTH = (signal.SIGINT, signal.SIGTERM)


def started(*command, cwd, modules=""):
    """Start Python as the leader of a process group, as a shell would: with signals' defaults."""
    return subprocess.Popen(
        [sys.executable, *command],
        cwd=cwd,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(modules)])},
        start_new_session=True,
        preexec_fn=lambda: [signal.signal(number, signal.SIG_DFL) for number in BOTH],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_until(condition, process, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.02)


def ended(process, seconds=30.0):
    """Exit code, output and lines on standard error; no process of its group is left."""
    out, err = process.communicate(timeout=seconds)
    end = time.monotonic() + 20
    while group_of(process.pid):
        assert time.monotonic() < end, group_of(process.pid)
        time.sleep(0.05)
    return process.returncode, out, error_lines(err)


def group_of(leader):
    """Processes of a group that have not ended."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[2]) == leader and fields[0] != "Z":
            found.append(stat.parent.name)
    return found


# campaigns

RUNS = "campaign.runs=2500"


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    return make(tmp_path_factory.mktemp("whole") / "campaign", RUNS)


@pytest.mark.parametrize(
    ("kind", "number"),
    [("threads", signal.SIGINT), ("processes", signal.SIGINT), ("processes", signal.SIGTERM)],
)
def test_an_interrupted_campaign_keeps_what_is_finished(tmp_path, uninterrupted, kind, number):
    # one by one, which takes many times the two seconds between writes
    overrides = [*SHORT, RUNS, "campaign.batch=1", "campaign.store=campaign", f"cluster={kind}"]
    command = ["-m", "pipeline.simulate", *overrides]
    victim = started(*command, cwd=tmp_path)
    path = tmp_path / "campaign"
    wait_until((path / "status" / "c").exists, victim)
    os.killpg(victim.pid, number)
    code, out, lines = ended(victim)
    assert (code, out) == (128 + number, "")
    status = store.read(path).status
    done = int((status == store.DONE).sum())
    assert 0 < done < 2500
    again = shlex.join([sys.executable, *command])
    assert lines == [f"interrupted: {done} of 2500 runs are kept in campaign; to go on: {again}"]
    # neither lock nor dask's own folders
    assert {file.name for file in tmp_path.iterdir()} == {path.name, log_path(path).name}
    make(path, RUNS)
    assert_same_store(path, uninterrupted)


@pytest.mark.parametrize("kind", ["threads", "processes"])
def test_batches_that_are_given_up_say_nothing(tmp_path, kind):
    overrides = [*SHORT, RUNS, "campaign.batch=64", "campaign.store=campaign", f"cluster={kind}"]
    # a second for every batch: some are at work whenever the interrupt comes
    overrides += ["schedule.position_duration_s=4000"]
    victim = started("-m", "pipeline.simulate", *overrides, cwd=tmp_path)
    wait_until((tmp_path / "campaign" / "status" / "c").exists, victim)
    os.killpg(victim.pid, signal.SIGINT)
    code, out, lines = ended(victim)
    assert (code, out, len(lines)) == (130, "", 1), lines
    assert lines[0].startswith("interrupted: ")


BUSY = """
import os, signal, threading, time
from pipeline.campaign import cluster
from pipeline.config.load import load
from pipeline.console import interrupts

with interrupts.raised(), interrupts.telling(lambda: "interrupted"):
    with cluster.client(load(["cluster.workers=1"]).cluster) as client:
        client.loop.add_callback(time.sleep, 2)
        threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
        client.sync(client.scheduler.identity)
"""


def test_a_loop_that_has_not_begun_what_is_given_up_says_nothing(tmp_path):
    # as where the machine is busy; distributed cancels a future that it does not have yet
    assert ended(started("-c", BUSY, cwd=tmp_path)) == (130, "", ["interrupted"])


def test_all_that_is_finished_is_written_when_the_interrupt_comes(tmp_path, monkeypatch):
    # between two writes of the campaign's own
    monkeypatch.setattr(fan_out, "_FLUSH_INTERVAL_S", 1e9)
    advance, finished = driver.CampaignProgress.advance, []

    def advance_and_interrupt(self, runs):
        finished.append(runs)
        if len(finished) == 5:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.01)  # in the middle of what must not be torn
        advance(self, runs)

    monkeypatch.setattr(driver.CampaignProgress, "advance", advance_and_interrupt)
    path = tmp_path / "campaign"
    stopped = run_stage(simulate, *SHORT, "campaign.batch=2", f"campaign.store={path}")
    assert stopped.code == 130
    assert int((store.read(path).status == store.DONE).sum()) == sum(finished) == 10
    assert error_lines(stopped.err)[0].startswith(
        f"interrupted: 10 of 30 runs are kept in {path}; to"
    )
    assert len(error_lines(stopped.err)) == 1


def test_an_interrupt_while_the_workers_start(tmp_path, monkeypatch):
    start = cluster._start

    def interrupted(*arguments):
        os.kill(os.getpid(), signal.SIGTERM)
        return start(*arguments)

    monkeypatch.setattr(cluster, "_start", interrupted)
    path = tmp_path / "campaign"
    stopped = run_stage(simulate, *SHORT, f"campaign.store={path}")
    assert stopped.code == 143
    (line,) = error_lines(stopped.err)
    assert line.startswith(f"interrupted: 0 of 30 runs are kept in {path}; to go on: ")
    with pytest.raises(ValueError, match="No global client"):
        get_client()  # what started after all was closed


# other stages

STAGE = """
import os, signal, sys, time
from pathlib import Path
from pipeline.console import interrupts
from pipeline.console import output
from pipeline.config.stage import stage

@stage(writes=(".json",))
def main(config):
    print("begun", flush=True)
    if config.out:
        output.write_text(config.out, "text")
    if config.accept:
        with interrupts.held():
            print("holding", flush=True)
            time.sleep(60)
    time.sleep(60)

if __name__ == "__main__":
    main()
"""


@pytest.fixture
def waiting(tmp_path):
    """Start a stage that does nothing but wait."""
    (tmp_path / "modules").mkdir()
    (tmp_path / "modules" / "waiting_stage.py").write_text(STAGE)
    processes = []

    def start(*arguments, lines):
        process = started(
            "-m", "waiting_stage", *arguments, cwd=tmp_path, modules=tmp_path / "modules"
        )
        processes.append(process)
        for _ in range(lines):
            process.stdout.readline()
        return process

    yield start
    for process in processes:
        process.kill()
        process.wait()


@pytest.mark.parametrize("number", BOTH)
def test_an_interrupted_stage_ends_with_one_line(waiting, number):
    process = waiting(lines=1)
    os.killpg(process.pid, number)
    assert ended(process) == (128 + number, "", ["interrupted: nothing written"])


def test_an_interrupted_stage_names_what_it_wrote(waiting, tmp_path):
    process = waiting("out=file.json", lines=1)
    wait_until((tmp_path / "file.json").exists, process)
    time.sleep(0.2)
    os.killpg(process.pid, signal.SIGINT)
    assert ended(process) == (130, "", ["interrupted: file.json written"])


def test_a_second_interrupt_ends_at_once_even_what_is_held(waiting):
    process = waiting("accept=x", lines=2)
    os.killpg(process.pid, signal.SIGINT)
    time.sleep(0.1)
    os.killpg(process.pid, signal.SIGINT)  # the same one, sent to process and group
    time.sleep(2 * interrupts._SAME_S)
    assert process.poll() is None
    start = time.monotonic()
    os.killpg(process.pid, signal.SIGINT)
    assert ended(process) == (130, "", [])
    assert time.monotonic() - start < 5


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs Linux")
def test_an_interrupt_during_the_imports_leaves_no_traceback(tmp_path):
    process = started("-m", "pipeline.simulate", *SHORT, cwd=tmp_path)

    def takes_signals():
        status = Path(f"/proc/{process.pid}/status").read_text()
        caught = int(re.search(r"SigCgt:\s*(\w+)", status)[1], 16)
        return caught >> (signal.SIGTERM - 1) & 1

    wait_until(takes_signals, process)
    os.killpg(process.pid, signal.SIGINT)
    assert ended(process) == (130, "", ["interrupted: nothing written"])
    assert [*tmp_path.iterdir()] == []


def test_ignored_signals_stay_ignored(monkeypatch):
    # as nohup wants it
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with interrupts.raised():
            os.kill(os.getpid(), signal.SIGINT)
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_nothing_is_logged_between_an_interrupt_and_the_end(caplog):
    # by a logger with a level of its own
    logger = logging.getLogger("a.library")
    logger.setLevel(logging.ERROR)

    def interrupted():
        logger.error("before")
        try:
            signal.raise_signal(signal.SIGINT)
        finally:
            logger.critical("between")

    with pytest.raises(interrupts.Interrupt), interrupts.raised():
        interrupted()
    logger.error("after")
    assert caplog.messages == ["before", "after"]


def test_handlers_are_given_back():
    before = [signal.getsignal(number) for number in BOTH]
    with pytest.raises(interrupts.Interrupt), interrupts.raised():
        signal.raise_signal(signal.SIGTERM)
    assert [signal.getsignal(number) for number in BOTH] == before


# two campaigns at once


def test_one_writer_of_a_store_at_a_time(tmp_path):
    path = tmp_path / "folder" / "campaign"
    with writing(path):
        refused = run_stage(simulate, *SHORT, f"campaign.store={path}")
        assert refused.code == 2
        said = f"error: campaign.store = {path}: another process is writing it"
        assert error_lines(refused.err) == [said]
        assert not path.exists()
    assert run_stage(simulate, *SHORT, f"campaign.store={path}").code == 0
    assert {*path.parent.iterdir()} == {path, log_path(path)}


def test_a_killed_writer_leaves_no_lock(tmp_path):
    code = (
        "import sys, time; from pipeline.campaign.lock import writing\n"
        "with writing(sys.argv[1]): print(); time.sleep(60)"
    )
    path = tmp_path / "campaign"
    process = started("-c", code, str(path), cwd=tmp_path)
    process.stdout.readline()
    assert run_stage(simulate, *SHORT, f"campaign.store={path}").code == 2
    process.kill()
    ended(process)
    assert run_stage(simulate, *SHORT, f"campaign.store={path}").code == 0


def test_two_clusters_at_once_say_nothing(tmp_path):
    one = load(["cluster.workers=1"]).cluster
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with cluster.client(one), cluster.client(replace(one, kind="processes")):
            pass


# strangers at the scheduler's address


class _Page(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        self.send_response(200)
        self.end_headers()

    def log_message(self, *_):
        pass


def test_a_foreign_service_at_the_address(tmp_path, monkeypatch):
    monkeypatch.setitem(cluster._SETTINGS, "distributed.comm.timeouts.connect", "500ms")
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), _Page) as service:
        threading.Thread(target=service.serve_forever, daemon=True).start()
        address = f"tcp://127.0.0.1:{service.server_port}"
        start = time.monotonic()
        refused = run_stage(
            simulate,
            *(*SHORT, "cluster=scheduler", f"cluster.address={address}"),
            f"campaign.store={tmp_path / 'campaign'}",
        )
        service.shutdown()
    assert refused.code == 2
    assert error_lines(refused.err) == [f"error: cluster.address = {address}: no scheduler answers"]
    assert time.monotonic() - start < 20


def test_a_worker_is_no_scheduler(tmp_path):
    with LocalCluster(
        n_workers=1, processes=False, protocol="tcp", host="127.0.0.1", dashboard_address=":0"
    ) as other:
        address = other.workers[0].address
        config = short(tmp_path / "campaign", "cluster=scheduler", f"cluster.address={address}")
        with pytest.raises(cluster.DataError, match="no scheduler answers"):
            driver.simulate_campaign(config)
