"""How a package's kernels are compiled: cached on disk, without the interpreter lock."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar, cast

from numba import njit

Kernel = TypeVar("Kernel", bound=Callable[..., object])


def compiler(folder: Path) -> Callable[[Kernel], Kernel]:
    """Return a decorator that compiles kernels which release the interpreter lock.

    Numba's cache looks at a kernel's own file only; a kernel calls those of other files, so its
    cache carries the stamp of them all.

    Args:
        folder: Holds the kernels and what they call.
    """
    sources = [path.stat() for path in folder.glob("*.py")]
    stamp = max(entry.st_mtime for entry in sources), sum(entry.st_size for entry in sources)

    def compiled(kernel: Kernel) -> Kernel:
        dispatcher = njit(cache=True, nogil=True)(kernel)
        dispatcher._cache._cache_file._source_stamp = stamp
        return cast(Kernel, dispatcher)

    return compiled
