"""Small campaigns and stages run in this process, for the tests that need a store."""

import io
import json
import subprocess
import sys
import time
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

import numpy as np
import zarr

from pipeline.campaign import manifest, store
from pipeline.campaign.driver import simulate_campaign
from pipeline.campaign.worker import Limit
from pipeline.config.load import load

ROOT = Path(__file__).resolve().parents[1]
"""The repository."""

SHORT = (
    "schedule.position_duration_s=40",
    "schedule.rotations=[[90,Y],[180,Y],[90,X]]",
    "campaign.runs=30",
)
"""A path that takes a millisecond per run; with it not all parameters can be told apart."""

LIMIT = Limit(600.0, own_process=False)

ATTRIBUTES_IN_JSON = {"configuration", "software", "exceptions"}


def short(path, *overrides):
    return load([*SHORT, f"campaign.store={path}", *overrides])


def make(path, *overrides):
    """Make a small campaign and return its path."""
    simulate_campaign(short(path, *overrides))
    return path


def set_status(path, part, value):
    """Give runs another status, as if they had been written so."""
    zarr.open_group(path, mode="r+")["status"][part] = value
    manifest.seal(Path(path), manifest.read(Path(path)).fingerprint)


def make_older(path, *keys):
    """Make a store as it was before: no manifest, nested attributes, a setting not yet there."""
    about = json.loads((path / "zarr.json").read_text())
    attributes = about["attributes"]
    for name in ATTRIBUTES_IN_JSON & attributes.keys():
        attributes[name] = json.loads(attributes[name])
    if keys:
        *groups, last = keys
        configuration = attributes["configuration"]
        for key in groups:
            configuration = configuration[key]
        del configuration[last]
    (path / "zarr.json").write_text(json.dumps(about))
    (path / manifest.NAME).unlink()


def files(path):
    """Bytes of a store's files but for the root attributes, which name path and batch."""
    return {
        str(file.relative_to(path)): file.read_bytes()
        for file in Path(path).rglob("*")
        if file.is_file() and file != Path(path) / "zarr.json"
    }


def assert_same_store(a, b):
    left, right = store.read(a), store.read(b)
    for name in left.variables:
        assert left[name].dtype == right[name].dtype
        if left[name].dtype.kind in "TO":  # texts, each version its way
            assert left[name].values.tolist() == right[name].values.tolist()
        else:
            assert np.array(left[name]).tobytes() == np.array(right[name]).tobytes(), name
    assert files(a) == files(b)


@dataclass
class Ended:
    code: int
    out: str
    err: str


def run_stage(module, *overrides):
    """Run a stage's main function as its command line would, and return how it ended."""
    out, err = io.StringIO(), io.StringIO()
    code = 0
    with (
        mock.patch.object(sys, "argv", [module.__name__, *overrides]),
        redirect_stdout(out),
        redirect_stderr(err),
    ):
        try:
            module.main()
        except SystemExit as stop:
            code = stop.code
    return Ended(code, out.getvalue(), err.getvalue())


def error_lines(err):
    """Lines on standard error without the warnings of a path so short."""
    return [line for line in err.splitlines() if not line.startswith("warning: ")]


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


def fake_slurm(folder):
    """Make sbatch and scancel of one machine: a job is a process group, its number the leader's."""
    folder.mkdir()
    sbatch = (
        f'script={folder}/job.$$\ncp "$1" $script\n'  # dask-jobqueue deletes its own
        f'setsid bash $script >$script.log 2>&1 &\necho "Submitted batch job $!"'
    )
    for name, text in {"sbatch": sbatch, "scancel": 'kill -- "-$1"'}.items():
        (folder / name).write_text(f"#!/bin/bash\n{text}\n")
        (folder / name).chmod(0o755)


def wait_until(condition, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.02)
