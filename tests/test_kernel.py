import ast
from pathlib import Path

import numpy as np
import pytest
from numba import njit

import inscal
from inscal.kernel import CACHE_LINE, RUN_MODULES, empty_aligned, prefetch, source_digest

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


def test_kernels_are_in_modules_that_name_their_cache():
    compiled = {path.stem for path in LIBRARY.glob("*.py") if "@njit" in path.read_text()}
    assert compiled - set(RUN_MODULES) == {"effects", "free_inertial"}


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
