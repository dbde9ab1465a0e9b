"""Runs that end, hang or starve their worker process: each must be named, and the others made.

Usage: ``python tests/faults/runs.py [kind ...]``

Works in a folder of its own that it makes.
"""

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from campaigns import SHORT
from place import folder_of_its_own

from pipeline.campaign import store

KINDS = ("exit", "end", "machine_code", "memory", "never")
"""Kinds of `preload`."""
RUN = 13
PRELOAD = Path(__file__).with_name("preload.py")


def campaign(folder: Path, kind: str, *overrides: str, workers: int = 2) -> tuple[int, str, Path]:
    """Make a campaign with one faulty run in worker processes: exit code, stderr and store."""
    path = folder / kind
    environment = {
        **os.environ,
        "INSCAL_FAULT": f"{kind}:{RUN}",
        "DASK_DISTRIBUTED__WORKER__PRELOAD": json.dumps([str(PRELOAD)]),
        "DASK_DISTRIBUTED__NANNY__PRE_SPAWN_ENVIRON__MALLOC_TRIM_THRESHOLD_": "65536",
    }
    limit = "campaign.batch_time_limit_s=30" if kind == "never" else ""
    command = [sys.executable, "-m", "pipeline.simulate", *SHORT, "cluster=processes"]
    command += [f"cluster.workers={workers}", f"campaign.store={path}", *filter(None, [limit])]
    done = subprocess.run(
        [*command, "campaign.max_failed_share=1", *overrides],
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
    )
    return done.returncode, done.stderr, path


def judged(code: int, stderr: str, path: Path) -> str:
    """``named`` if the faulty run, and no other, has failed and is named; else what happened."""
    if code != 0:
        return f"exit {code}: {stderr[-500:]}"
    found = store.read(path)
    failed = [int(n) for n in found["run"][found["status"] == store.FAILED]]
    told = [line for line in stderr.splitlines() if f"run {RUN} failed" in line]
    if failed != [RUN] or len(told) != 1 or "Traceback" in stderr:
        return f"failed: {failed}; said: {stderr[-500:]}"
    return "named"


def main(kinds: list[str]) -> int:
    """Try every kind; the number that was not as it is to be."""
    folder, wrong = folder_of_its_own(), 0
    try:
        for kind in kinds:
            began = time.monotonic()
            met = judged(*campaign(folder, kind))
            print(f"{kind}: {met} ({time.monotonic() - began:.0f} s)", flush=True)
            wrong += met != "named"
    finally:
        shutil.rmtree(folder)
    return wrong


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:] or [*KINDS]))
