"""How this package compiles a kernel: cached on disk, without the interpreter lock."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

from numba import njit

Kernel = TypeVar("Kernel", bound=Callable[..., object])


def compiled(kernel: Kernel) -> Kernel:
    """Return a kernel compiled by Numba that releases the interpreter lock."""
    return cast(Kernel, njit(cache=True, nogil=True)(kernel))
