"""The runner of stages: what it makes of a function, how a stage ends, and what it leaves."""

import os
import subprocess
import sys

import pytest
from campaigns import ROOT

STAGE = '''"""Stage `small`: what `stage` makes of a function.

Usage: ``python -m small_stage [noise=...]``

Reads: noise out.
"""

from pipeline.config.load import load
from pipeline.config.stage import stage
from pipeline.console.errors import DataError

@stage
def main(config):
    if config.accept == "data":
        raise DataError("results: no store")
    if config.accept == "interrupt":
        raise KeyboardInterrupt
    if config.accept == "defect":
        raise ValueError("a defect")
    print(config.noise.name, load(["noise=noisy"]).noise.name)

if __name__ == "__main__":
    main()
'''


@pytest.fixture
def run_stage(tmp_path):
    """Run a small stage in an empty directory; return its result and what it left there."""
    (tmp_path / "modules").mkdir()
    (tmp_path / "modules" / "small_stage.py").write_text(STAGE)
    cwd = tmp_path / "cwd"
    cwd.mkdir()
    roots = [str(tmp_path / "modules"), str(ROOT)]
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(roots)}

    def run(*arguments):
        command = [sys.executable, "-m", "small_stage", *arguments]
        result = subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True)
        return result, sorted(path.name for path in cwd.iterdir())

    return run


def test_stage_runs_and_leaves_nothing(run_stage):
    result, left = run_stage("noise=quiet")
    assert (result.returncode, result.stdout, result.stderr) == (0, "quiet noisy\n", "")
    assert left == []


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["campaign.runs=0"], "campaign.runs = 0: must be an integer >= 1"),
        (["noise=loud"], "noise = loud: must be one of mems, noisy, quiet, reference"),
        (["noise.extra=1"], "noise.extra: unknown key; must be one of name"),
        (["noise"], "'noise': must be group=option or key=value"),
        (["noise=null"], "noise = null: must be one of"),
        (["accept=data"], "results: no store"),
    ],
    ids=lambda value: str(value)[:40],
)
def test_stage_refuses_in_one_line(run_stage, arguments, said):
    result, left = run_stage(*arguments)
    assert result.returncode == 2
    assert result.stdout == ""
    assert result.stderr.startswith("error: ")
    assert said in result.stderr
    assert result.stderr.count("\n") == 1
    assert left == []


def test_stage_interrupted(run_stage):
    result, left = run_stage("accept=interrupt")
    assert (result.returncode, result.stdout) == (130, "")
    assert result.stderr == "interrupted: nothing written\n"
    assert left == []


def test_stage_keeps_the_traceback_of_a_defect(run_stage):
    result, _ = run_stage("accept=defect")
    assert result.returncode == 1
    assert "Traceback" in result.stderr
    assert "ValueError: a defect" in result.stderr


def test_stage_keeps_hydras_own_options(run_stage):
    shown, left = run_stage("--cfg", "job", "noise=quiet")
    assert shown.returncode == 0
    assert "name: quiet" in shown.stdout
    assert left == []
    helped, left = run_stage("--help")
    assert helped.stdout.splitlines()[:6] == [
        "small_stage: what stage makes of a function.",
        "",
        "usage: python -m small_stage [noise=...]",
        "",
        "reads of the configuration, the default first:",
        "  noise=reference|mems|noisy|quiet",
    ]
    assert left == []
    swept, left = run_stage("-m", "noise=quiet,noisy")
    assert swept.stdout == "quiet noisy\nnoisy noisy\n"
    assert left == ["results"]


def test_configuration_does_not_import_the_heavy_libraries():
    code = (
        "import sys, pipeline.config.load as l; "
        "print({'numba', 'dask', 'xarray', 'scipy'} & {*sys.modules})"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert result.stdout == "set()\n"
