"""How a package's kernels are compiled: cached on disk, without the interpreter lock."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar, cast

from numba import njit

Kernel = TypeVar("Kernel", bound=Callable[..., object])


def compiled(kernel: Kernel) -> Kernel:
    """Compile a kernel of a package; its machine code is kept on disk.

    Numba's cache looks at a kernel's own file only; a kernel calls those of other files, so its
    cache carries the stamp of the whole package.
    """
    dispatcher = njit(cache=True, nogil=True)(kernel)
    dispatcher._cache._cache_file._source_stamp = _stamp(kernel.__module__.partition(".")[0])
    return cast(Kernel, dispatcher)


@functools.cache
def _stamp(package: str) -> tuple[float, int]:
    """Return the latest change and the total size of a package's sources."""
    source = sys.modules[package].__file__
    assert source is not None
    sources = [path.stat() for path in Path(source).parent.rglob("*.py")]
    return max(entry.st_mtime for entry in sources), sum(entry.st_size for entry in sources)
