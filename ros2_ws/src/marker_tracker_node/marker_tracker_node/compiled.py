"""How this package compiles a kernel: cached on disk, without the interpreter lock."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar, cast

from numba import njit

Kernel = TypeVar("Kernel", bound=Callable[..., object])


def _package_stamp() -> tuple[float, int]:
    sources = [path.stat() for path in Path(__file__).parent.glob("*.py")]
    return max(entry.st_mtime for entry in sources), sum(entry.st_size for entry in sources)


_STAMP = _package_stamp()


def compiled(kernel: Kernel) -> Kernel:
    """Return a kernel compiled by Numba that releases the interpreter lock.

    Numba's cache looks at a kernel's own file only; kernels here call those of other files, so
    their cache carries the stamp of the whole package.
    """
    dispatcher = njit(cache=True, nogil=True)(kernel)
    dispatcher._cache._cache_file._source_stamp = _STAMP
    return cast(Kernel, dispatcher)
