"""How kernels are compiled: kept on disk, without the interpreter lock."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

from winding_core.lean_numba import numba  # isort: skip - before its parts

from numba.extending import register_jitable

from winding_core.kernel_cache import cached

Kernel = TypeVar("Kernel", bound=Callable[..., object])


def compiled(kernel: Kernel) -> Kernel:
    """Compile a kernel of a package when it is first called; see `kernel_cache` for its code."""
    return cast(Kernel, cached(numba.njit(nogil=True)(kernel)))


def called(kernel: Kernel) -> Kernel:
    """Compile a function within the kernels that call it; Python runs it as it is written.

    What Python never calls needs no entry from there, which takes as long to compile as a short
    kernel itself, and no code of its own on disk.
    """
    return cast(Kernel, register_jitable(kernel))
