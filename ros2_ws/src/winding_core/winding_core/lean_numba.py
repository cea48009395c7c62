"""Numba, imported without what it tries to import and the kernels have no use of."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

# A tracer of lines, which sees none of compiled code, the reader of a configuration file, and a
# library of which only the version is looked at.
_NEEDLESS = ("coverage", "yaml", "scipy")


@contextmanager
def _without(*names: str) -> Iterator[None]:
    """Let imports of modules fail in the body."""
    loaded = {name: sys.modules[name] for name in names if name in sys.modules}
    sys.modules.update(dict.fromkeys(names))  # type: ignore[arg-type]
    try:
        yield
    finally:
        for name in names:
            del sys.modules[name]
        sys.modules.update(loaded)


with _without(*_NEEDLESS):
    import numba

__all__ = ["numba"]
