"""How kernels are compiled: cached machine code, or plain Python under NUMBA_DISABLE_JIT=1."""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

from winding_core.lean_numba import numba  # isort: skip - before its parts

from numba.extending import register_jitable

from winding_core.kernel_cache import cached, code_folder

P = ParamSpec("P")
R = TypeVar("R")

# NaN must stay visible to the divergence check, so "nnan" and "ninf" are left out.
_REORDER = {"reassoc", "contract", "arcp", "nsz"}


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile an array function to cached machine code that releases the interpreter lock."""
    compile_ = numba.njit(nogil=True, fastmath=_REORDER, error_model="numpy")
    return cast(Callable[P, R], cached(compile_(function)))


def called(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function within the kernels that call it; Python runs it as it is written.

    An entry from Python, with all its arrays taken apart, takes as long to compile as the function.
    What is called with a literal stays a kernel: here the literal would be one argument among
    others, and sums that may be reordered would round differently.
    """
    within = register_jitable(nogil=True, fastmath=_REORDER, error_model="numpy")
    return cast(Callable[P, R], within(function))


def is_compiled() -> bool:
    """Return whether there is machine code of earlier runs.

    Under NUMBA_DISABLE_JIT=1 there is nothing to compile.
    """
    if numba.config.DISABLE_JIT:
        return True
    return any(code_folder("cable_fem_node").rglob("*.nbi"))
