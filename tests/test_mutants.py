"""The generator of mutants, and that its copies are the only place it writes to."""

import ast
import subprocess

import mutants
import pytest
from mutations import mutations

SOURCE = b'''"""Text - with * signs."""
import numpy as np

RATE = 7.5

@inlined
def turned(u, v, dt, latitude: float = -1.0):
    """Another text > 0."""
    if dt > 0 and not u:
        raise ValueError(f"{dt + 1}")
    return (u[1] * np.sin(latitude), v * dt - np.cos(latitude))

def plain(start, end):
    return start
'''


def made(kind=None):
    return [m for m in mutations("some", SOURCE) if kind in (None, m.kind)]


def test_every_mutant_changes_one_place_and_can_be_read():
    for mutation in made():
        ast.parse(mutation.source)
        assert mutation.source != SOURCE
        assert mutation.source.count(b"\n") == SOURCE.count(b"\n")
        changed = mutation.source.split(b"\n")
        lines = SOURCE.split(b"\n")
        differ = [i for i, (a, b) in enumerate(zip(lines, changed, strict=True), 1) if a != b]
        assert differ == [mutation.line]
        assert mutation.text == lines[mutation.line - 1].decode().strip()


def test_signs_operators_numbers_names_and_intervals_are_changed():
    found = {(m.line, m.kind, m.old, m.new) for m in made()}
    assert found == {
        (4, "number", "7.5", "11.25"),
        (7, "sign", "-", ""),
        (7, "number", "1.0", "1.5"),
        (9, "operator", ">", ">="),
        (9, "operator", ">", "<"),
        (9, "operator", "and", "or"),
        (9, "number", "0", "1"),
        (9, "sign", "not ", ""),
        (9, "interval", "dt", "1.0"),
        (11, "operator", "*", "/"),
        (11, "operator", "-", "+"),
        (11, "number", "1", "2"),
        (11, "name", "sin", "cos"),
        (11, "name", "cos", "sin"),
        (11, "interval", "dt", "1.0"),
        (14, "name", "start", "end"),
    }


def test_what_machine_code_holds_is_known():
    assert {m.line: m.compiled for m in made()} == {
        4: True, 7: True, 9: True, 11: True, 14: False
    }  # fmt: skip


def test_nothing_is_written_but_to_a_copy_made_here(tmp_path):
    before = mutants.source_of("earth")
    with pytest.raises(RuntimeError, match="no file of a copy"):
        mutants.Copy(mutants.ROOT).write("earth", b"")
    (tmp_path / "inscal").mkdir()
    with pytest.raises(RuntimeError, match="no file of a copy"):
        mutants.Copy(tmp_path).write("earth", b"")
    (tmp_path / mutants.MARK).touch()
    with pytest.raises(RuntimeError, match="no file of a copy"):
        mutants.Copy(tmp_path).write("../../earth", b"")
    mutants.Copy(tmp_path).write("earth", b"x = 1\n")
    assert (tmp_path / "inscal" / "earth.py").stat().st_size == len(before) + mutants.ROOM
    assert mutants.source_of("earth") == before


def test_a_mutants_size_and_time_are_those_of_the_source(tmp_path):
    (tmp_path / "inscal").mkdir()
    (tmp_path / mutants.MARK).touch()
    copy, stats = mutants.Copy(tmp_path), set()
    source = mutants.source_of("rotation")
    for mutation in [None, *mutations("rotation", source)[::40]]:
        copy.write("rotation", mutation.source if mutation else source)
        about = (tmp_path / "inscal" / "rotation.py").stat()
        stats.add((about.st_size, about.st_mtime))
    assert len(stats) == 1


def test_a_copy_is_of_what_git_knows(monkeypatch, tmp_path):
    monkeypatch.setattr(mutants.tempfile, "mkdtemp", lambda prefix: str(tmp_path))
    copy = mutants.Copy.make()
    listed = subprocess.run(
        ["git", "ls-files"], cwd=mutants.ROOT, capture_output=True, text=True, check=True
    ).stdout.split("\n")
    assert (copy.root / "inscal" / "earth.py").read_bytes().startswith(mutants.source_of("earth"))
    assert all((copy.root / name).exists() for name in listed if (mutants.ROOT / name).is_file())
    assert not (copy.root / ".git").exists()


def test_a_command_that_fails_kills(tmp_path):
    copy = mutants.Copy(tmp_path)
    assert copy.run("-c", "pass")
    assert not copy.run("-c", "raise SystemExit(1)")
