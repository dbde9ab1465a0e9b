"""How the compiled kernels are built: lanes, memory, compiler options, and where code is cached.

Kernels work on *lanes*: runs side by side in the last, contiguous axis of an array, always exactly
`LANES` of them, so that the compiler turns every lane loop into vector instructions without a
remainder. Whatever lane a run sits in, it goes through the same instructions; that is what makes
results independent of batch size to the last bit.

A kernel is a function under `compiled`, a scalar function that kernels call one under `inlined`,
and a piece of such a function one under `spliced`. The first of them calls `configure`, which sets
what numba has to know before it compiles.
"""

import hashlib
import os
import tempfile
import warnings
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir
from numba import config, njit, types
from numba.core.registry import cpu_target
from numba.extending import intrinsic

LANES = 32
"""Runs side by side in the innermost loop: enough to share the traffic of the gains."""

CACHE_LINE = 64
"""Bytes; also the width of the widest vector."""

RUN_MODULES = (
    *(
        "augmentation",
        "augmented_transitions",
        "calibrator",
        "closed_loop",
        "convergence",
        "directions",
        "disturbance",
    ),
    *("disturbed", "earth", "estimator", "experiment", "kernel", "motion", "navigation"),
    *("parameters", "path", "profile", "record", "recursion", "response", "rotation", "schedule"),
    *("sensor", "simulation", "state_model", "statistics", "unit_effects", "units", "wander"),
)
"""Modules that the result of a run depends on: all that `inscal.experiment` imports."""

_PACKAGE = Path(__file__).parent

_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}
# `contract` allows fused multiply-add and nothing else: no reordering, so the result is defined by
# the source up to the rounding of a product


def compiled(function: Callable) -> Any:
    """Decorate a kernel, which Python calls and which loops over lanes.

    Parameters
    ----------
    function : callable

    Returns
    -------
    numba.core.dispatcher.Dispatcher
        Compiled at the first call; the code is kept in `cache_folder`.
    """
    return njit(cache=configure() is not None, **_OPTIONS)(function)


def inlined(function: Callable) -> Any:
    """Decorate a scalar function that lane loops call.

    A loop becomes vector instructions only around code that is inlined, so this always is.

    Parameters
    ----------
    function : callable

    Returns
    -------
    numba.core.dispatcher.Dispatcher
    """
    return njit(cache=configure() is not None, forceinline=True, **_OPTIONS)(function)


def spliced(function: Callable) -> Any:
    """Decorate a piece of a longer scalar function, cut out to have a name.

    Its lines stand in the caller before anything is optimised, so the cut changes no bit. That of
    `inlined` may: which product of a sum is fused depends on what the compiler sees with it.

    Parameters
    ----------
    function : callable

    Returns
    -------
    numba.core.dispatcher.Dispatcher
    """
    return njit(cache=configure() is not None, inline="always", **_OPTIONS)(function)


@cache
def configure() -> Path | None:
    """Set numba's options, which are those of the whole process; only the first call does.

    - Compiled code is kept in `cache_folder`.
    - Processors with AVX-512 use their full width, which LLVM avoids by default, unless
      ``NUMBA_CPU_FEATURES`` says what to use. The kernels do little else than lane loops, and run a
      fifth faster for it.
    - Arrays made in a kernel begin on a cache line. Without it a tenth of a pass is a matter of
      luck.

    `compiled`, `inlined` and `spliced` call it, so a program need not. One that compiles kernels of
    its own calls it first if they are to be built alike.

    Returns
    -------
    Path or None
        Folder of the compiled code. None, and a warning, where no folder can be written: the
        process then compiles for itself.
    """
    folder = cache_folder(config.CACHE_DIR)
    if folder is None:
        warnings.warn(
            "no folder for compiled code can be written, so every start compiles anew, for some "
            "ten seconds; NUMBA_CACHE_DIR names a folder to use",
            stacklevel=2,
        )
    else:
        config.CACHE_DIR = str(folder)
    features = llvm.get_host_cpu_features()
    if "NUMBA_CPU_FEATURES" not in os.environ and features.get("avx512f"):
        config.CPU_NAME = llvm.get_host_cpu_name()
        config.CPU_FEATURES = f"{features.flatten()},-prefer-256-bit"
    cpu_target.target_context.get_preferred_array_alignment = lambda _: CACHE_LINE
    return folder


def cache_folder(chosen: str = "") -> Path | None:
    """Find a folder for the code compiled from this very source.

    numba asks of a cached kernel whether its own file has changed, not whether those have whose
    functions were inlined into it: an edited sensor model would leave a stale calibrator. So the
    folder is named after all source of the library, wherever it is.

    Parameters
    ----------
    chosen : str
        Folder that the user wants it in, as by ``NUMBA_CACHE_DIR``; tried first if not empty.

    Returns
    -------
    Path or None
        Sub-folder of the chosen folder, of ``__pycache__`` beside the source or of the user's
        caches, the first that can be written; None if none can.
    """
    digest = source_digest(sorted(path.stem for path in _PACKAGE.glob("*.py")))
    parents = [Path(chosen)] if chosen else []
    parents.append(_PACKAGE / "__pycache__")
    of_user = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))
    if of_user.is_absolute():  # a process may have no home
        parents.append(of_user / "inscal")
    for parent in parents:
        folder = parent / f"kernels-{digest[:16]}"
        if _can_write(folder):
            return folder
    return None


def _can_write(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def is_compiled(module: str) -> bool:
    """Whether code of kernels in a module is kept, so that this process need not compile them.

    Parameters
    ----------
    module : str
        Such as ``calibrator``.
    """
    folder = configure()
    return folder is not None and any(folder.rglob(f"{module}.*.nbc"))


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
        digest.update((_PACKAGE / f"{name}.py").read_bytes())
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
