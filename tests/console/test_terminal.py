"""What stages show: help, tables that fit a window, and progress where nothing else is written."""

import ast
import importlib
import io
import re
import shlex
import subprocess
import sys
import time
from dataclasses import replace

import pytest
from campaigns import ROOT, SHORT, make, run_stage

from inscal import kernel
from inscal.parameters import NAMES, UNITS
from pipeline import compare, observe, predict, summarize
from pipeline.config.load import PRODUCT, load
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.console import help, progress
from pipeline.paper.config import PROGRAM

_FILES = [*(ROOT / "pipeline").glob("*.py"), *(ROOT / "pipeline").glob("*/__main__.py")]
STAGES = {
    path.parent.name if path.stem == "__main__" else path.stem: path
    for path in sorted(_FILES)
    if "\n@stage" in path.read_text()
}
HELP, WIDTH, LENGTH = 100, 80, 40


def stage_help(name):
    return help.help_text(STAGES[name])


def program_of(name):
    """What the stage reads: the paper's stages may have groups of their own."""
    return PROGRAM if "pipeline.paper.config import" in STAGES[name].read_text() else PRODUCT


# help


@pytest.mark.parametrize("name", STAGES)
def test_help_is_short_and_begins_with_what_the_stage_does(name):
    lines = stage_help(name).splitlines()
    assert lines[0].startswith(f"{name}: ")
    assert f"python -m pipeline.{name}" in stage_help(name)
    assert len(lines) <= LENGTH
    assert max(map(len, lines)) <= HELP


@pytest.mark.parametrize("name", STAGES)
def test_examples_of_the_help_are_valid(name):
    for line in stage_help(name).splitlines():
        if line.startswith("  python -m"):
            assert shlex.split(line)[:3] == ["python", "-m", f"pipeline.{name}"]
            load(shlex.split(line, comments=True)[3:], program_of(name))


def test_help_lists_choices_and_keys_as_conf_has_them():
    lines = stage_help("simulate").splitlines()
    assert "  noise=reference|mems|noisy|quiet" in lines
    assert "  site.KEY                        latitude_deg, height_m" in lines
    (runs,) = [line for line in lines if line.startswith("  campaign.runs=")]
    assert re.match(r"  campaign\.runs=500 +the most there will be", runs)


@pytest.mark.parametrize("name", ["simulate", "bench"])
def test_help_is_printed_before_the_heavy_libraries_are_imported(name):
    command = [sys.executable, "-X", "importtime", "-m", f"pipeline.{name}", "noise=quiet"]
    start = time.monotonic()
    result = subprocess.run([*command, "--help"], cwd=ROOT, capture_output=True, text=True)
    assert time.monotonic() - start < 1.5
    assert (result.returncode, result.stdout) == (0, f"{stage_help(name)}\n")
    imported = {line.rpartition("|")[2].strip() for line in result.stderr.splitlines()}
    assert "pipeline.console.help" in imported
    assert not imported & {"numpy", "scipy", "numba", "dask", "distributed", "hydra"}


def test_help_of_a_stage_that_is_imported_already():
    ended = run_stage(predict, "noise=quiet", "-h")
    assert (ended.code, ended.out, ended.err) == (0, f"{stage_help('predict')}\n", "")


READ: set[str] = set()


class Recording(Config):
    """A configuration that remembers which of its groups were looked at."""

    def __getattribute__(self, name):
        # a copy with something replaced looks at everything
        if not name.startswith("_") and sys._getframe(1).f_globals["__name__"] != "dataclasses":
            READ.add(name)
        return object.__getattribute__(self, name)


CASES = {
    "predict": [*SHORT],
    "observe": [*SHORT],
    "budget": [*SHORT, "disturbance=laboratory"],
    "disturbances": [
        *(*SHORT, "disturbance.accel_drift_ug=3", "campaign.store=drifting", "out=drifting.json")
    ],
    "summarize": ["campaign.store=campaign"],
    "compare": ["a=campaign", "b=campaign"],
    "paper_effects": ["effects.duration_s=60"],
    "paper_laboratory": [
        *(*SHORT, "laboratory.runs=2", "laboratory.residual_passes=[2]"),
        "laboratory.residual_scale_factors_ppm=[300.0]",
    ],
}


@pytest.mark.parametrize("name", CASES)
def test_help_names_every_group_that_is_read(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    make("campaign")
    config = load(CASES[name], program_of(name))
    config.__class__ = Recording
    READ.clear()
    importlib.import_module(f"pipeline.{name}").main.__wrapped__(config)
    doc = ast.get_docstring(ast.parse(STAGES[name].read_text()))
    named = {entry.partition(".")[0] for entry in help.read_by(doc)}
    if name == "paper_laboratory":
        named.add("truth")  # looked at, but it has truths of its own
    assert named >= READ
    assert READ


# tables


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    make("two_pass")
    make("one_pass", "estimator=one_pass")
    make("diverging", "truth.accel_quadratic_1e_9=4000", "campaign.max_failed_share=1")
    return tmp_path


def widths(text):
    return [len(line.rstrip()) for line in text.splitlines()]


@pytest.mark.parametrize("columns", ["40", "250"])
def test_tables_fit_a_window_of_80_columns_and_cut_nothing_off(folder, monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", columns)
    outputs = {
        "summarize": run_stage(summarize, "campaign.store=two_pass").out,
        "summarize, the widest numbers": run_stage(
            summarize, "campaign.store=diverging", "bounds.gyro_bias_deg_per_h=0.00123"
        ).out,
        "compare": run_stage(compare, "a=one_pass", "b=two_pass").out,
        "predict": run_stage(predict).out,
        "predict, of few states": run_stage(predict, "estimator.states=[gyro_bias]").out,
        "observe": run_stage(observe).out,
        "observe, a short path": run_stage(observe, *SHORT).out,
    }
    for name, out in outputs.items():
        assert max(widths(out)) <= WIDTH, name
        assert "…" not in out, name
        for parameter in NAMES:
            assert any(f" {parameter} " in line for line in out.splitlines()), name
    for name, parts in {"summarize": 2, "compare": 1, "predict": 1}.items():
        # a line per parameter in each part of the table: nothing wraps
        rows = [line.split() for line in outputs[name].splitlines()]
        assert [row[0] for row in rows if row and row[0] in NAMES] == parts * list(NAMES)
    for name in ("summarize", "predict"):
        rows = [line.split() for line in outputs[name].splitlines()]
        units = [row[1] for row in rows if row and row[0] in NAMES]
        assert units[: len(UNITS)] == list(UNITS)


# progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def test_a_loop_reports_now_and_then_where_there_is_no_terminal(clock, capsys):
    seen = []
    for item in progress.track(list("abcdefgh"), "letters"):
        seen.append(item)
        clock[0] += 4.0
    assert seen == list("abcdefgh")
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines() == ["letters: 3 of 8, 20 s left", "letters: 6 of 8, 8 s left"]


def test_a_loop_that_does_not_know_its_length(clock, capsys):
    for _ in progress.track(iter(range(4)), "numbers", 4):
        clock[0] += 6.0
    assert capsys.readouterr().err.splitlines() == ["numbers: 2 of 4, 12 s left"]


def test_short_loops_show_nothing(monkeypatch, capsys):
    assert [*progress.track(range(3), "numbers")] == [0, 1, 2]
    with progress.busy("something"):
        pass
    monkeypatch.setattr(sys, "stderr", Terminal())
    assert [*progress.track(range(3), "numbers")] == [0, 1, 2]
    with progress.busy("something"):
        pass
    assert "numbers" not in sys.stderr.getvalue()
    assert "something" not in sys.stderr.getvalue()
    assert capsys.readouterr() == ("", "")


def test_a_terminal_sees_a_bar(monkeypatch, capsys):
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setattr(progress, "_PATIENCE_S", 0.02)
    monkeypatch.setenv("TERM", "xterm")
    for _ in progress.track(range(3), "numbers"):
        time.sleep(0.15)
    with progress.busy("something"):
        time.sleep(0.15)
    shown = sys.stderr.getvalue()
    assert "numbers" in shown
    assert "2/3" in shown
    assert "something" in shown
    assert shown.count("\x1b[?25h") == 2  # the cursor is back
    assert capsys.readouterr().out == ""


def test_compilation_is_announced_to_a_terminal(monkeypatch):
    config = load([*SHORT])
    for there, terminal, said in ((False, True, 1), (True, True, 0), (False, False, 0)):
        stream = Terminal() if terminal else io.StringIO()
        monkeypatch.setattr(sys, "stderr", stream)
        monkeypatch.setattr(kernel, "is_compiled", lambda _, there=there: there)
        assert Setup(replace(config)).experiment
        assert stream.getvalue().count("compiling the kernels, once") == said
