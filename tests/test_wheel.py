"""The package as it is installed: a wheel in a folder of its own, used from an empty one."""

import os
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest
import yaml
from campaigns import ROOT

import inscal
from pipeline.console import command

NO_INDEX = ("--no-deps", "--no-index", "--disable-pip-version-check", "--quiet")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    before = {*ROOT.iterdir()}
    pip = [sys.executable, "-m", "pip", "wheel", *NO_INDEX, "--no-build-isolation", "-w", folder]
    subprocess.run([*pip, ROOT], check=True, cwd=folder, capture_output=True)
    assert {*ROOT.iterdir()} == before  # building leaves nothing behind
    (file,) = folder.glob("*.whl")
    return file


@pytest.fixture(scope="module")
def run(wheel, tmp_path_factory):
    """The program `inscal` of the wheel in an empty folder; dependencies are this environment's."""
    site, folder = tmp_path_factory.mktemp("site"), tmp_path_factory.mktemp("empty")
    pip = [sys.executable, "-m", "pip", "install", *NO_INDEX, "--target", site]
    subprocess.run([*pip, wheel], check=True, capture_output=True)

    def run(*words, cwd=folder):
        environment = {**os.environ, "PYTHONPATH": str(site), "PATH": f"{site}/bin:/usr/bin:/bin"}
        code = "import inscal.command; inscal.command.main()"
        return subprocess.run(
            [sys.executable, "-c", code, *words],
            cwd=cwd,
            env=environment,
            capture_output=True,
            text=True,
        )

    run.folder, run.site = folder, site
    return run


def test_nothing_but_inscal_is_installed(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.partition("/")[0] for name in names} == {
        "inscal",
        f"inscal-{inscal.__version__}.dist-info",
    }
    assert "inscal/app/conf/config.yaml" in names
    assert not [name for name in names if "/tests/" in name or "__pycache__" in name]


def test_the_library_alone_needs_four_packages(wheel):
    folder = f"inscal-{inscal.__version__}.dist-info"
    about = zipfile.ZipFile(wheel).read(f"{folder}/METADATA").decode()
    needed = [line for line in about.splitlines() if line.startswith("Requires-Dist:")]
    plain = [line.split()[1].partition(">")[0] for line in needed if "extra ==" not in line]
    assert sorted(plain) == ["numba", "numpy", "scipy", "xarray"]


def test_stages_run_in_an_empty_folder_with_what_is_shipped(run):
    assert run("--version").stdout == f"{inscal.__version__}\n"
    predicted = run("predict", "noise=quiet")
    assert (predicted.returncode, predicted.stderr) == (0, "")
    assert "position25, noise quiet" in predicted.stdout
    short = ("schedule.position_duration_s=40", "schedule.rotations=[[90,Y],[180,Y]]")
    made = run("simulate", *short, "campaign.runs=8", "cluster=processes", "campaign.batch=4")
    assert made.returncode == 0, made.stderr
    assert (run.folder / "results" / "runs" / "position25-reference" / "zarr.json").exists()


def test_the_pipeline_is_the_wheels_own_whatever_else_has_its_name(run, tmp_path):
    (tmp_path / "pipeline").mkdir()
    (tmp_path / "pipeline" / "__init__.py").write_text("raise SystemExit('not this one')\n")
    shown = run("--help", cwd=tmp_path)
    assert shown.returncode == 0
    assert str(run.site) in shown.stdout.splitlines()[-1]


def test_own_files_stand_beside_those_that_are_shipped(run, tmp_path):
    (tmp_path / "conf" / "noise").mkdir(parents=True)
    quiet = (ROOT / "conf" / "noise" / "quiet.yaml").read_text()
    (tmp_path / "conf" / "noise" / "own.yaml").write_text(quiet.replace("name: quiet", "name: own"))
    found = run("predict", "noise=own", cwd=tmp_path)
    assert found.returncode == 0
    assert found.stderr == f"configuration: {tmp_path / 'conf'}, then what is shipped\n"
    refused = run("predict", "noise=loud", cwd=tmp_path).stderr.splitlines()[-1]
    assert refused == "error: noise = loud: must be one of mems, noisy, own, quiet, reference"
    elsewhere = run("predict", "noise=own", "--config-dir", str(tmp_path / "conf"))
    assert elsewhere.stdout == found.stdout


def test_init_makes_a_study_to_start_from(run, tmp_path):
    assert run("init", "study", cwd=tmp_path).returncode == 0
    study = tmp_path / "study"
    assert "position25, noise" not in run("predict", "schedule=mine", cwd=study).stdout
    about = yaml.safe_load((study / "dvc.yaml").read_text())
    assert set(about["stages"]) == {"simulate", "summarize", "compare", "page"}
    again = run("init", "study", cwd=tmp_path)
    assert (again.returncode, again.stderr.count("\n")) == (2, 1)
    assert "has conf and dvc.yaml already" in again.stderr


def test_the_overview_lists_every_stage_once():
    files = [*(ROOT / "pipeline").glob("*.py"), *(ROOT / "pipeline").glob("*/__main__.py")]
    stages = {f.parent.name if f.stem == "__main__" else f.stem for f in files} - {"__init__"}
    assert sorted(name for names in command.WORK.values() for name in names) == sorted(stages)
    lines = command.overview().splitlines()
    assert max(len(line) for line in lines[:-1]) <= 100


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_are_told_what_completes(run, shell):
    told = run("completion", shell)
    assert told.returncode == 0
    assert "simulate" in told.stdout
    refused = run("completion", "cmd")
    assert (refused.returncode, refused.stderr.count("\n")) == (2, 1)


def test_the_program_is_installed(run):
    assert (run.site / "bin" / "inscal").exists()
    assert Path(sysconfig.get_path("scripts"), "inscal").exists()
