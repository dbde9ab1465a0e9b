"""What `import inscal` says and does."""

import subprocess
import sys
import textwrap
from pathlib import Path

import inscal


def test_its_docstring_shows_a_calibration_that_works():
    names = {}
    exec(textwrap.dedent(inscal.__doc__.split("::\n", 1)[1]), names)
    outcome = names["outcome"]
    assert outcome.truth.shape == outcome.estimate.shape == (20, 27)
    assert not outcome.failed.any()
    assert 20 < outcome.nees.mean() < 35  # 27 expected


def test_it_imports_nothing():
    code = "import sys, inscal; print(sorted({'numpy', 'numba', 'scipy'} & {*sys.modules}))"
    root = Path(inscal.__file__).parent.parent
    ended = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True)
    assert ended.stdout == "[]\n", ended.stderr
