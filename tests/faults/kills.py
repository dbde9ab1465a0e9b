"""Kills and interrupts campaigns at random moments, and looks whether anything is lost.

Usage: ``python tests/faults/kills.py [kills] [victim ...]``

Works in a folder of its own that it makes. Whatever was killed, the same command must end with the
store that an undisturbed one has, to the last bit; after workers alone, without being given again.
"""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from campaigns import SHORT, assert_same_store, make
from place import folder_of_its_own

RUNS = "campaign.runs=1500"
_REPRO = [sys.executable, "-m", "dvc", "repro"]
_BEFORE = ("warning: ", "store: ")  # what a campaign says that is not interrupted
_START_S, _WHOLE_S = 1.0, 8.0
_STUDY = """stages:
  simulate:
    cmd: >-
      {command}
    outs: [store: {{cache: false, persist: true}}]
  summarize:
    cmd: {python} -m pipeline.summarize campaign.store=store
    deps: [store]
    outs: [results: {{cache: false}}]
"""


def command(*overrides: str) -> list[str]:
    """A campaign of many small batches in worker processes."""
    how = ("cluster=processes", "campaign.batch=4", "campaign.store=store", RUNS)
    return [sys.executable, "-m", "pipeline.simulate", *SHORT, *how, *overrides]


def started(words: list[str], place: Path) -> subprocess.Popen:
    """A command in a process group of its own."""
    return subprocess.Popen(
        words,
        cwd=place,
        start_new_session=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def workers_of(pid: int) -> list[int]:
    """Worker processes below a process."""
    found = subprocess.run(["ps", "-eo", "pid,ppid,args"], capture_output=True, text=True).stdout
    lines = [line.split(None, 2) for line in found.splitlines()[1:]]
    below, out = {pid}, []
    for number, parent, text in lines:
        if int(parent) in below:
            below.add(int(number))
            if "multiprocessing.spawn" in text:
                out.append(int(number))
    return out


def kill_driver(running: subprocess.Popen, rng: random.Random) -> None:
    """The process that writes the store, at any moment."""
    time.sleep(rng.uniform(_START_S, _WHOLE_S))
    running.kill()


def kill_group(running: subprocess.Popen, rng: random.Random) -> None:
    """All of its processes at once, at any moment."""
    time.sleep(rng.uniform(_START_S, _WHOLE_S))
    os.killpg(running.pid, signal.SIGKILL)


def kill_worker(running: subprocess.Popen, rng: random.Random) -> None:
    """One worker process, at any moment."""
    time.sleep(rng.uniform(_START_S, _WHOLE_S))
    for pid in rng.sample(found, 1) if (found := workers_of(running.pid)) else []:
        os.kill(pid, signal.SIGKILL)


def kill_starting_worker(running: subprocess.Popen, rng: random.Random) -> None:
    """The first worker process there is, as soon as it is or within a second."""
    wait = rng.uniform(0.0, 1.0)
    while running.poll() is None and not workers_of(running.pid):
        time.sleep(0.01)
    time.sleep(wait)
    for pid in workers_of(running.pid)[:1]:
        os.kill(pid, signal.SIGKILL)


def interrupt(running: subprocess.Popen, rng: random.Random) -> None:
    """Ctrl-C, which reaches all of its processes, at any moment."""
    time.sleep(rng.uniform(_START_S, _WHOLE_S))
    os.killpg(running.pid, signal.SIGINT)


def start_second(running: subprocess.Popen, rng: random.Random) -> None:
    """Nothing is killed: a second `dvc repro` in the same folder, at any moment."""
    place = Path(f"/proc/{running.pid}/cwd").resolve()
    time.sleep(rng.uniform(0.0, _WHOLE_S))
    second = started(_REPRO, place)
    said = second.communicate(timeout=300)[0]
    if "Traceback" in said:
        raise SystemExit(said)


VICTIMS: dict[str, Callable[[subprocess.Popen, random.Random], None]] = {
    "driver": kill_driver,
    "group": kill_group,
    "interrupted": interrupt,
    "worker": kill_worker,
    "starting_worker": kill_starting_worker,
    "dvc": kill_group,
    "second_dvc": start_second,
}


def words_of(victim: str, place: Path) -> list[str]:
    """Command to be killed, in a folder made for it."""
    if "dvc" not in victim:
        return command()
    quoted = " ".join(f"'{word}'" for word in command())
    (place / "dvc.yaml").write_text(_STUDY.format(command=quoted, python=sys.executable))
    for start in (["git", "init", "-q"], [sys.executable, "-m", "dvc", "init", "-q"]):
        subprocess.run(start, cwd=place, check=True, capture_output=True)
    return _REPRO


def tried(victim: str, good: Path, rng: random.Random) -> str:
    """Kill once, go on, compare: ``as it was`` or what was wrong."""
    place = good.parent / "victim"
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir()
    words = words_of(victim, place)
    running = started(words, place)
    VICTIMS[victim](running, rng)
    said = running.communicate(timeout=300)[0]
    told = [line for line in said.splitlines() if not line.startswith(_BEFORE)]
    if running.returncode == 128 + signal.SIGINT and len(told) != 1:
        return f"not one line: {told}"
    if "worker" not in victim:
        _wait_for_orphans(place)
        running = started(words, place)
        said += running.communicate(timeout=300)[0]
    if running.returncode or "Traceback" in said:
        return f"exit {running.returncode}: {said}"
    try:
        assert_same_store(place / "store", good)
    except AssertionError as error:
        return f"not the same: {error}"
    return "as it was"


def _wait_for_orphans(place: Path) -> None:
    """Workers of a killed driver end by themselves."""
    end = time.monotonic() + 60
    while time.monotonic() < end:
        found = subprocess.run(["pgrep", "-f", "multiprocessing.spawn"], capture_output=True)
        if found.returncode:
            return
        time.sleep(0.2)


def main(kills: int, victims: list[str]) -> int:
    """Kill every victim so many times; the number of kills that were not survived."""
    folder, rng, wrong = folder_of_its_own(), random.Random(1), 0
    try:
        good = make(folder / "good", RUNS)
        for victim in victims:
            met = [tried(victim, good, rng) for _ in range(kills)]
            print(f"{victim}: {met.count('as it was')} of {kills} as it was", flush=True)
            for what in {*met} - {"as it was"}:
                print(f"  {what}")
            wrong += kills - met.count("as it was")
    finally:
        shutil.rmtree(folder)
    return wrong


if __name__ == "__main__":
    kills, *victims = sys.argv[1:] or ["30"]
    raise SystemExit(main(int(kills), victims or [*VICTIMS]))
