"""How the compiled kernels are built: one set of options, one lane width.

Kernels work on *lanes*: runs side by side in the last, contiguous axis of an array, always exactly
`LANES` of them, so that the compiler turns every lane loop into vector instructions without a
remainder. Whatever lane a run sits in, it goes through the same instructions; that is what makes
results independent of batch size to the last bit.
"""

LANES = 16
"""Runs side by side in the innermost loop."""

KERNEL = {
    "cache": True,
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract"},
}
"""Compiler options of every kernel. `contract` allows fused multiply-add and nothing else:
no reordering, so the result is defined by the source up to the rounding of a product."""

INLINE = {**KERNEL, "forceinline": True}
"""Options of the scalar functions that a lane loop calls: a loop vectorises only around code that
was inlined."""
