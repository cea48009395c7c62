"""How kernels are compiled: cached machine code, or plain Python under NUMBA_DISABLE_JIT=1."""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

from winding_core.kernel_cache import cached, code_folder
from winding_core.lean_numba import numba

P = ParamSpec("P")
R = TypeVar("R")

# NaN must stay visible to the divergence check, so "nnan" and "ninf" are left out.
_REORDER = {"reassoc", "contract", "arcp", "nsz"}


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile an array function to cached machine code that releases the interpreter lock."""
    compile_ = numba.njit(nogil=True, fastmath=_REORDER, error_model="numpy")
    return cast(Callable[P, R], cached(compile_(function)))


def is_compiled() -> bool:
    """Return whether there is machine code of earlier runs.

    Under NUMBA_DISABLE_JIT=1 there is nothing to compile.
    """
    if numba.config.DISABLE_JIT:
        return True
    return any(code_folder("cable_fem_node").rglob("*.nbi"))
