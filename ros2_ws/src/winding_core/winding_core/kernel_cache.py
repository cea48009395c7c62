"""Machine code of kernels on disk: one folder per state of the sources, for all checkouts.

Numba compares code with the file that holds its function alone, and keeps it beside that file.
Here the folder's name says what every source was that the code may have been made of, so code of
other sources is never found, and two checkouts of the same sources have theirs in common.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import io
import os
import pickle
import shutil
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from winding_core.lean_numba import numba  # isort: skip - before its parts

from numba.core.caching import (
    Cache,
    CompileResultCacheImpl,
    IndexDataCacheFile,
    _CacheLocator,
)
from numba.core.environment import Environment, _rebuild_env, lookup_environment
from numba.core.runtime import rtsys

# What a kernel may call or take constants from, beside its own package.
_SHARED = "winding_core"
# Code that nobody has loaded for so long is deleted when other code is made [s].
_KEPT_FOR = 30 * 24 * 3600.0


def code_folder(package: str) -> Path:
    """Return the folder of a package's machine code, which may not exist yet.

    It lies in NUMBA_CACHE_DIR where that is set, else in the user's cache folder.

    Args:
        package: An imported package.
    """
    root = Path(numba.config.CACHE_DIR or _user_folder() / "winding-kernels")
    return root / f"{package}-{_sources(package)[:16]}"


def cached(dispatcher: Callable[..., object]) -> Callable[..., object]:
    """Let a function that numba compiles keep its machine code on disk.

    Under NUMBA_DISABLE_JIT=1 it is plain Python and stays so.
    """
    if not numba.config.DISABLE_JIT:
        try:
            dispatcher._cache = _KernelCache(dispatcher.py_func)  # type: ignore[attr-defined]
        except (OSError, RuntimeError) as error:
            # Python shows the same warning once in a process.
            warnings.warn(f"every process compiles its kernels anew: {error}", stacklevel=1)
    return dispatcher


def _user_folder() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


@functools.cache
def _sources(package: str) -> str:
    """Return a digest of all that the kernels of a package, or of a module alone, are made of."""
    digest = hashlib.sha256(f"{numba.__version__} {np.__version__}".encode())
    for name in sorted({package, _SHARED}):
        file = Path(str(sys.modules[name].__file__))
        folder = file.parent
        alone = file.name != "__init__.py"
        for source in [file] if alone else sorted(folder.rglob("*.py")):
            content = source.read_bytes()
            digest.update(f"{name} {source.relative_to(folder)} {len(content)}\n".encode())
            digest.update(content)
    return digest.hexdigest()


@functools.cache
def _opened(folder: Path) -> None:
    """Make a folder of code, and forget what nobody uses any more; note that this one is used.

    Raises:
        OSError: It cannot be made or written to.
    """
    new = not folder.exists()
    # Code is run as it is found, so nobody else may write there.
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    os.utime(folder)
    now = folder.stat().st_mtime
    for other in folder.parent.glob(f"{folder.name.rpartition('-')[0]}-*") if new else ():
        with contextlib.suppress(OSError):
            if now - other.stat().st_mtime > _KEPT_FOR:
                shutil.rmtree(other, ignore_errors=True)


class _Place(_CacheLocator):  # type: ignore[misc]
    """Where the code of a function lies."""

    def __init__(self, function: Callable[..., object]) -> None:
        package = function.__module__.partition(".")[0]
        if sys.modules[package].__file__ is None:
            # A folder of scripts or tests is no package.
            package = function.__module__
        folder = code_folder(package)
        _opened(folder)
        self._stamp = _sources(package)
        self._folder = folder / function.__module__
        self._line = function.__code__.co_firstlineno

    @classmethod
    def from_function(cls, function: Callable[..., object], file: str) -> _Place:
        return cls(function)

    def get_cache_path(self) -> str:
        return str(self._folder)

    def get_source_stamp(self) -> str:
        return self._stamp

    def get_disambiguator(self) -> str:
        return str(self._line)


class _Code(CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes = (_Place,)


def _environment(module: str, constants: list[object], name: str) -> Any:
    """Return what ready code of a function has around it, without importing the function's module.

    Code that was made without Python objects reads no globals. A module of numba whose function a
    kernel calls, such as np.zeros, would bring half of what numba can compile with it.
    """
    if module in sys.modules or lookup_environment(name) is not None:
        return _rebuild_env(module, constants, name)
    made = Environment({"__name__": module})
    made.consts[:] = constants
    made.env_name = name
    Environment._memo[name] = made
    return made


class _Reader(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        found = super().find_class(module, name)
        return _environment if found is _rebuild_env else found


class _Files(IndexDataCacheFile):  # type: ignore[misc]
    def _load_data(self, name: str) -> Any:
        return _Reader(io.BytesIO(Path(self._data_path(name)).read_bytes())).load()


class _KernelCache(Cache):  # type: ignore[misc]
    _impl_class = _Code

    def __init__(self, function: Callable[..., object]) -> None:
        super().__init__(function)
        self._cache_file = _Files(
            cache_path=self._cache_path,
            filename_base=self._impl.filename_base,
            source_stamp=self._impl.locator.get_source_stamp(),
        )

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return ready code, or None.

        Numba would first import and register whatever it can compile, half a processor second;
        ready code needs only its runtime. A compilation registers the rest by itself.
        """
        rtsys.initialize(target_context)
        return self._load_overload(sig, target_context)
