"""How kernels are compiled: cached machine code, or plain Python under NUMBA_DISABLE_JIT=1."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import ParamSpec, TypeVar

from numba import config, njit

from winding_core import material_law

P = ParamSpec("P")
R = TypeVar("R")

# NaN must stay visible to the divergence check, so "nnan" and "ninf" are left out.
_REORDER = {"reassoc", "contract", "arcp", "nsz"}

_PACKAGE = Path(__file__).parent.parent


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile an array function to cached machine code that releases the interpreter lock."""
    compiled: Callable[P, R] = njit(cache=True, nogil=True, fastmath=_REORDER, error_model="numpy")(
        function
    )
    return compiled


def drop_stale_code(folder: Path, *shared: Path) -> None:
    """Delete cached machine code that is older than any source below a folder.

    Numba compares code only with the file that holds the function, not with the files of the
    functions it calls: an edited kernel would live on inside its callers.

    Args:
        folder: Holds the kernels and what they call, at any depth.
        shared: Files elsewhere whose constants are compiled into the kernels.
    """
    newest = max(source.stat().st_mtime for source in (*folder.rglob("*.py"), *shared))
    for cached in folder.rglob("__pycache__/*.nb[ci]"):
        with contextlib.suppress(FileNotFoundError, PermissionError):
            if cached.stat().st_mtime < newest:
                cached.unlink()


def is_compiled() -> bool:
    """Return whether machine code of earlier runs lies beside this package (or where Numba caches).

    Under NUMBA_DISABLE_JIT=1 there is nothing to compile.
    """
    if config.DISABLE_JIT:
        return True
    folder = Path(config.CACHE_DIR) if config.CACHE_DIR else _PACKAGE
    return any(folder.rglob("*.nbi"))


drop_stale_code(_PACKAGE, Path(material_law.__file__))
