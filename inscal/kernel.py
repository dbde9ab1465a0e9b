"""How the compiled kernels are built: lane width, compiler options, and where code is cached.

Kernels work on *lanes*: runs side by side in the last, contiguous axis of an array, always exactly
`LANES` of them, so that the compiler turns every lane loop into vector instructions without a
remainder. Whatever lane a run sits in, it goes through the same instructions; that is what makes
results independent of batch size to the last bit.
"""

import hashlib
import os
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
from numba import config

LANES = 32
"""Runs side by side in the innermost loop: enough to share the traffic of the gains."""

KERNEL: dict[str, Any] = {
    "cache": True,
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract"},
}
"""Compiler options of every kernel. `contract` allows fused multiply-add and nothing else:
no reordering, so the result is defined by the source up to the rounding of a product."""

INLINE: dict[str, Any] = {**KERNEL, "forceinline": True}
"""Options of the scalar functions that a lane loop calls: a loop vectorises only around code that
was inlined."""


def _cache_by_source() -> None:
    """Name the cache of compiled code after the source of the whole library.

    A cached kernel is looked up by the age of its own file, not of the files whose functions were
    inlined into it; without this an edited sensor model would leave a stale calibrator.
    """
    folder = Path(__file__).parent
    if "NUMBA_CACHE_DIR" in os.environ or not os.access(folder, os.W_OK):
        return
    digest = hashlib.sha256()
    for source in sorted(folder.glob("*.py")):
        digest.update(source.read_bytes())
    config.CACHE_DIR = str(folder / "__pycache__" / f"kernels-{digest.hexdigest()[:16]}")


def _use_full_vectors() -> None:
    """Let AVX-512 processors use their full width, which LLVM avoids by default.

    The kernels do little else than lane loops, and run a fifth faster for it.
    """
    features = llvm.get_host_cpu_features()
    if "NUMBA_CPU_FEATURES" not in os.environ and features.get("avx512f"):
        config.CPU_NAME = llvm.get_host_cpu_name()
        config.CPU_FEATURES = f"{features.flatten()},-prefer-256-bit"


_cache_by_source()
_use_full_vectors()
