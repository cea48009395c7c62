"""How kernels are compiled: kept on disk, without the interpreter lock."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

from winding_core.kernel_cache import cached
from winding_core.lean_numba import numba

Kernel = TypeVar("Kernel", bound=Callable[..., object])


def compiled(kernel: Kernel) -> Kernel:
    """Compile a kernel of a package when it is first called; see `kernel_cache` for its code."""
    return cast(Kernel, cached(numba.njit(nogil=True)(kernel)))
