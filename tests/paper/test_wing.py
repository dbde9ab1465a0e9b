"""The reproduction of the paper comes off: nothing of the product imports it."""

import ast
import json
import os
import shutil
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import pytest

from pipeline.console.errors import DataError
from pipeline.console.output import write_json
from pipeline.study import claims

REPOSITORY = Path(__file__).resolve().parents[2]
WING = "pipeline.paper"


def is_wing(path):
    parts = path.relative_to(REPOSITORY).parts
    return parts[:2] == ("pipeline", "paper") or path.match("pipeline/paper_*.py")


def modules():
    folders = (REPOSITORY / "inscal", REPOSITORY / "pipeline")
    return [path for folder in folders for path in sorted(folder.rglob("*.py"))]


def imported(path):
    """Names of all that a module imports, with what it takes of them."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def test_nothing_of_the_product_imports_the_wing():
    own = [path for path in modules() if not is_wing(path)]
    assert len(own) > 50
    assert {path: name for path in own for name in imported(path) if name.startswith(WING)} == {}


@pytest.fixture(scope="module")
def without_wing(tmp_path_factory):
    """Copy of the repository, the wing removed."""
    copy = tmp_path_factory.mktemp("copy")
    for name in ("inscal", "pipeline", "conf"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(REPOSITORY / name, copy / name, ignore=ignored)
    shutil.rmtree(copy / "pipeline/paper")
    for path in (*copy.glob("pipeline/paper_*.py"), copy / "conf/paper.yaml"):
        path.unlink()
    return copy


def python(folder, *arguments):
    environment = os.environ | {"PYTHONPATH": str(folder)}
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


def test_every_other_module_is_imported_without_it(without_wing):
    names = [
        ".".join(path.relative_to(REPOSITORY).with_suffix("").parts).removesuffix(".__init__")
        for path in modules()
        if not is_wing(path) and path.name != "__main__.py"
    ]
    code = f"import importlib\nfor name in {names}: importlib.import_module(name)\n"
    code += "import pipeline; print(pipeline.__file__)"
    ended = python(without_wing, "-c", code)
    assert ended.stderr == ""
    assert ended.stdout.strip() == str(without_wing / "pipeline/__init__.py")


def test_a_stage_runs_without_it(without_wing):
    ended = python(without_wing, "-m", "pipeline.predict", "out=predicted.json")
    assert (ended.returncode, ended.stderr) == (0, "")
    assert json.loads((without_wing / "predicted.json").read_text())


def test_claims_reach_the_report_as_they_were_left(tmp_path):
    path = tmp_path / "claims.json"
    assert claims.read(path) is None
    left = claims.Claims(
        judged=[claims.Judged("Table 1", ["claim", "found", "verdict"], [["a", "1", "met"]])],
        estimates={"accel_bias_x": {"unit": "ug", "truth": 1.0}},
        margins={"accel_bias": {"gyro": float("inf"), "accel": 0.5}},
        largest_noise=256.0,
        rotations=[(90.0, "Y"), (0.0, "")],
        ranks=[12, 18],
    )
    write_json(path, asdict(left))
    assert claims.read(path) == left
    for text in ("no JSON", "[]", '{"judged": []}'):
        path.write_text(text)
        with pytest.raises(DataError, match="cannot be read"):
            claims.read(path)
