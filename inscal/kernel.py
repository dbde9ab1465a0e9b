"""How the compiled kernels are built: lanes, memory, compiler options, and where code is cached.

Kernels work on *lanes*: runs side by side in the last, contiguous axis of an array, always exactly
`LANES` of them, so that the compiler turns every lane loop into vector instructions without a
remainder. Whatever lane a run sits in, it goes through the same instructions; that is what makes
results independent of batch size to the last bit.
"""

import hashlib
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir
from numba import config, types
from numba.core.registry import cpu_target
from numba.extending import intrinsic

LANES = 32
"""Runs side by side in the innermost loop: enough to share the traffic of the gains."""

CACHE_LINE = 64
"""Bytes; also the width of the widest vector."""

RUN_MODULES = (
    *("calibrator", "directions", "earth", "estimator", "experiment", "kernel", "motion"),
    *("navigation", "parameters", "recursion", "rotation", "schedule", "sensor", "simulation"),
    *("state_model", "statistics", "units"),
)
"""Modules that the result of a run depends on: all that `inscal.experiment` imports."""

_OTHER_KERNELS = ("effects", "free_inertial")

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


def source_digest(modules: Sequence[str] = RUN_MODULES) -> str:
    """Digest of the source of modules of the library.

    Parameters
    ----------
    modules : sequence of str
        Those that decide the result of a run, if not said otherwise.

    Returns
    -------
    str
        Hexadecimal SHA-256.
    """
    digest = hashlib.sha256()
    for name in modules:
        digest.update((Path(__file__).parent / f"{name}.py").read_bytes())
    return digest.hexdigest()


def empty_aligned(shape: tuple[int, ...]) -> np.ndarray:
    """Array of doubles that begins on a cache line, so that no vector of lanes straddles two.

    Parameters
    ----------
    shape : tuple of int

    Returns
    -------
    ndarray
        Not initialised.
    """
    count = int(np.prod(shape))
    room = np.empty(8 * count + CACHE_LINE, dtype=np.uint8)
    first = -room.ctypes.data % CACHE_LINE
    return room[first : first + 8 * count].view(np.float64).reshape(shape)


@intrinsic
def prefetch(typingctx, array, offset):
    """Ask for the cache line `offset` bytes into an array, to be read soon; never an error.

    Records and gains are read once from far memory, in order. The processor's own prefetching
    starts anew at every page, and twelve lines of one step are more than it keeps up with.
    """
    pointer, number = ir.IntType(8).as_pointer(), ir.IntType(32)
    kind = ir.FunctionType(ir.VoidType(), [pointer, number, number, number])

    def generate(context, builder, signature, args):
        data = context.make_array(signature.args[0])(context, builder, args[0]).data
        function = builder.module.declare_intrinsic("llvm.prefetch", [pointer], kind)
        # for reading, into all levels of the cache, of data
        hints = [ir.Constant(number, value) for value in (0, 3, 1)]
        builder.call(function, [builder.gep(builder.bitcast(data, pointer), [args[1]]), *hints])
        return context.get_dummy_value()

    return types.void(array, offset), generate


def _cache_by_source() -> None:
    """Name the cache of compiled code after all source that is compiled.

    A cached kernel is looked up by the age of its own file, not of the files whose functions were
    inlined into it; without this an edited sensor model would leave a stale calibrator.
    """
    folder = Path(__file__).parent
    if "NUMBA_CACHE_DIR" in os.environ or not os.access(folder, os.W_OK):
        return
    digest = source_digest((*RUN_MODULES, *_OTHER_KERNELS))
    config.CACHE_DIR = str(folder / "__pycache__" / f"kernels-{digest[:16]}")


def _use_full_vectors() -> None:
    """Let AVX-512 processors use their full width, which LLVM avoids by default.

    The kernels do little else than lane loops, and run a fifth faster for it.
    """
    features = llvm.get_host_cpu_features()
    if "NUMBA_CPU_FEATURES" not in os.environ and features.get("avx512f"):
        config.CPU_NAME = llvm.get_host_cpu_name()
        config.CPU_FEATURES = f"{features.flatten()},-prefer-256-bit"
    # where arrays made in a kernel begin; without this a tenth of a pass is a matter of luck
    cpu_target.target_context.get_preferred_array_alignment = lambda _: CACHE_LINE


_cache_by_source()
_use_full_vectors()
