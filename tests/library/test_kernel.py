import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba import njit

import inscal
from inscal import kernel
from inscal.kernel import (
    CACHE_LINE,
    RUN_MODULES,
    configure,
    empty_aligned,
    prefetch,
    source_digest,
)

LIBRARY = Path(inscal.__path__[0])


def imported_by(module: str) -> set[str]:
    """Modules of the library that a module imports, by its source."""
    names = set()
    for node in ast.walk(ast.parse((LIBRARY / f"{module}.py").read_text())):
        if isinstance(node, ast.ImportFrom) and node.module == "inscal":
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("inscal."):
            names.add(node.module.removeprefix("inscal."))
    return names


def test_run_modules_are_all_that_an_experiment_imports():
    found, unseen = set(), {"experiment"}
    while unseen:
        found |= unseen
        unseen = set().union(*map(imported_by, unseen)) - found
    assert sorted(RUN_MODULES) == sorted(found)


def test_kernels_are_decorated_in_one_way_alone():
    users = {path.stem for path in LIBRARY.glob("*.py") if "njit" in path.read_text()}
    assert users == {"kernel"}


def test_options_wait_for_the_first_kernel():
    code = (
        "import numba\nbefore = numba.config.CACHE_DIR, numba.config.CPU_NAME\n"
        "import inscal.kernel as k\n"
        "assert (numba.config.CACHE_DIR, numba.config.CPU_NAME) == before\n"
        "import inscal.rotation\n"
        "assert numba.config.CACHE_DIR == str(k.configure())\n"
        "assert k.configure.cache_info().misses == 1"
    )
    ended = run_python(LIBRARY.parent, code)
    assert ended.returncode == 0, ended.stderr


USE = """
import numpy as np
from inscal import effects, kernel
p, g, out = np.full((27, 1), 1e-3), np.ones((15, 1)), np.empty((1, 6, 1))
effects._sense(p, g, np.ones((1, 3)), np.ones((1, 3)), 1.0, out)
print(out.sum())
print(kernel.configure())
"""
SIGN = "return (y + z) * p[_R, j]", "return -(y + z) * p[_R, j]"


def run_python(root, code, **environment):
    """Run code with the library in folder `root`, and nothing of where others keep theirs."""
    clean = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
    return subprocess.run(
        [sys.executable, "-c", code],
        env=clean | {"PYTHONPATH": str(root), "HOME": str(root)} | environment,
        cwd=root,
        capture_output=True,
        text=True,
        timeout=300,
    )


@pytest.fixture
def copied(tmp_path):
    """Folder with a copy of the library, to be edited."""
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(LIBRARY, tmp_path / "inscal", ignore=ignored)
    return tmp_path


def used(root, **environment):
    """What a kernel of `effects` computes, and where its code is kept."""
    ended = run_python(root, USE, **environment)
    assert ended.returncode == 0, ended.stderr
    value, folder = ended.stdout.split()
    return float(value), folder, ended.stderr


def edit_sensor(root):
    path = root / "inscal" / "sensor.py"
    source = path.read_text()
    assert SIGN[0] in source
    path.write_text(source.replace(*SIGN))


def no_package_folder(root):
    # no folder can be made in the place of a file, not even by the superuser
    (root / "inscal" / "__pycache__").write_text("")


@pytest.mark.parametrize("place", ["package", "chosen", "user"])
def test_compiled_code_follows_the_source_of_what_it_inlines(copied, place):
    own = {"package": "inscal/__pycache__", "chosen": "mine", "user": ".cache/inscal"}[place]
    environment = {"NUMBA_CACHE_DIR": str(copied / own)} if place == "chosen" else {}
    if place == "user":
        no_package_folder(copied)
    before, folder, said = used(copied, **environment)
    assert Path(folder).parent == copied / own
    assert said == ""
    code = sorted(Path(folder).rglob("*.nbc"))
    assert code
    edit_sensor(copied)
    after, other, _ = used(copied, **environment)
    assert Path(other).parent == copied / own
    assert other != folder
    assert after != before
    assert sorted(Path(folder).rglob("*.nbc")) == code


def test_kept_code_is_used_again(copied):
    def written():
        return {path: path.stat().st_mtime_ns for path in Path(folder).rglob("*.nbc")}

    _, folder, _ = used(copied)
    before = written()
    used(copied)
    assert written() == before


def test_where_nothing_can_be_written_kernels_work_and_that_is_said_once(copied):
    no_package_folder(copied)
    nowhere = {"HOME": os.devnull, "NUMBA_CACHE_DIR": f"{os.devnull}/x"}
    before, folder, said = used(copied, **nowhere)
    assert folder == "None"
    assert said.count("no folder for compiled code can be written") == 1
    assert "Traceback" not in said
    edit_sensor(copied)
    assert used(copied, **nowhere)[0] != before


def test_code_is_kept_where_there_is_a_file_of_it(tmp_path, monkeypatch):
    folder = tmp_path / "cache"
    folder.mkdir()
    monkeypatch.setattr(kernel, "configure", lambda: folder)
    assert not kernel.is_compiled("calibrator")
    (folder / "calibrator.calibrate-9.py311.1.nbc").touch()
    assert kernel.is_compiled("calibrator")
    assert not kernel.is_compiled("simulation")
    monkeypatch.setattr(kernel, "configure", lambda: None)
    assert not kernel.is_compiled("calibrator")


def test_digest_tells_modules_apart():
    assert source_digest(["earth"]) != source_digest(["rotation"])
    assert source_digest() == source_digest(RUN_MODULES)


@pytest.mark.parametrize("shape", [(1,), (7, 3), (5, 6, 32)])
def test_empty_aligned_begins_on_a_cache_line(shape):
    arrays = [empty_aligned(shape) for _ in range(20)]
    for array in arrays:
        assert array.shape == shape
        assert array.dtype == np.float64
        assert array.flags.c_contiguous
        assert array.flags.writeable
        assert array.ctypes.data % CACHE_LINE == 0


def test_arrays_of_kernels_begin_on_a_cache_line():
    configure()

    @njit
    def remainders(sizes):
        arrays = [np.empty(size) for size in sizes]
        return [array.ctypes.data % 64 for array in arrays]

    assert remainders(np.arange(1, 200)) == [0] * 199


def test_prefetch_reads_nothing_and_survives_the_end_of_an_array():
    @njit
    def touch(array):
        for offset in range(0, 10 * array.nbytes, 64):
            prefetch(array, offset)
        return array.sum()

    assert touch(np.ones(100)) == 100.0
