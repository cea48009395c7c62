"""Flags of the solver's kernels: sums may be reordered, a division by zero is infinite."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from winding_core import compiling

Kernel = TypeVar("Kernel", bound=Callable[..., object])

# NaN must stay visible to the divergence check, so "nnan" and "ninf" are left out.
_FLAGS: dict[str, Any] = {
    "fastmath": {"reassoc", "contract", "arcp", "nsz"},
    "error_model": "numpy",
}


def kernel(function: Kernel) -> Kernel:
    """Compile a kernel with the solver's flags; see `compiling.compiled`."""
    return compiling.compiled(function, **_FLAGS)


def called(function: Kernel) -> Kernel:
    """Compile a function within kernels, with the solver's flags; see `compiling.called`.

    What is called with a literal stays a kernel: here the literal would be one argument among
    others, and sums that may be reordered would round differently.
    """
    return compiling.called(function, nogil=True, **_FLAGS)


def is_compiled() -> bool:
    """Return whether every solver kernel that has been compiled has current code."""
    return compiling.is_compiled("cable_fem_node")
