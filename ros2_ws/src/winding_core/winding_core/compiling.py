"""How array functions become machine code, and where it is kept between processes.

Numba compares kept code with the file of its function alone. Here every kernel has a folder named
by a digest of all definitions of our packages that it reaches, without comments and docstrings: a
change compiles what it reaches, and no code outlives its sources.
"""

import ast
import contextlib
import functools
import hashlib
import importlib.util
import os
import shutil
import stat
import sys
import threading
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba.core import event
from numba.extending import register_jitable

from winding_core.compile_progress import PROGRESS

Kernel = TypeVar("Kernel", bound=Callable[..., object])

# Code that no process has loaded for so long is removed when other code is made [s].
_KEPT_FOR = 30 * 24 * 3600.0
_CACHES = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
_ROOT = Path(numba.config.CACHE_DIR or _CACHES) / "winding-kernels"
# Their versions stand for their sources.
_LIBRARIES = sys.stdlib_module_names | {"numba", "numpy"}
_placing = threading.Lock()


class _Compilations(event.Listener):  # type: ignore[misc]
    """Takes note of the kernels of `compiled` that the compiler turns to."""

    def on_start(self, event: Any) -> None:
        if (name := self._name(event)) in PROGRESS.missing:
            PROGRESS.begin(name)

    def on_end(self, event: Any) -> None:
        PROGRESS.end(self._name(event))

    @staticmethod
    def _name(event: Any) -> str:
        kernel = event.data["dispatcher"].py_func
        return f"{kernel.__module__}.{kernel.__qualname__}"


event.register("numba:compile", _Compilations())


def compiled(function: Kernel, **flags: Any) -> Kernel:
    """Compile a kernel when it is first called, without the interpreter lock, and keep its code.

    Where its code cannot be kept there is a warning. Under NUMBA_DISABLE_JIT=1 it stays as it is.

    Args:
        function: Array function, at the top level of a module.
        flags: Of `numba.njit`.
    """
    kernel = numba.njit(nogil=True, **flags)(function)
    if numba.config.DISABLE_JIT:
        return cast(Kernel, kernel)
    try:
        folder = _opened(_folder(function.__module__, function.__qualname__.partition(".")[0]))
        with _placing:
            before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(folder)
            try:
                kernel.enable_caching()
            finally:
                numba.config.CACHE_DIR = before
        # Instead numba takes another folder, whose code may be of other sources.
        if folder not in Path(kernel.stats.cache_path).parents:
            raise OSError(f"{_ROOT} cannot be written")
        new = not any(folder.glob("*/*.nbi"))
    except (OSError, RuntimeError) as error:
        # Python shows the same warning once in a process.
        warnings.warn(f"every process compiles its kernels anew: {error}", stacklevel=1)
        kernel, new = numba.njit(nogil=True, **flags)(function), True
    if new:
        PROGRESS.missing.add(f"{function.__module__}.{function.__qualname__}")
    return cast(Kernel, kernel)


def called(function: Kernel, **flags: Any) -> Kernel:
    """Compile a function within the kernels that call it; Python runs it as it is written.

    An entry from Python, with all its arrays taken apart, takes as long to compile as the function.

    Args:
        function: Array function that only kernels call.
        flags: Of `numba.njit`.
    """
    decorate = register_jitable(**flags) if flags else register_jitable
    return cast(Kernel, decorate(function))


def is_compiled(package: str) -> bool:
    """Return whether there is code of the present sources for kernels of a package.

    Under NUMBA_DISABLE_JIT=1 there is nothing to compile.
    """
    kept = {code.parents[1] for code in _ROOT.glob(f"{package}.*/*/*.nbi")}
    names = (folder.name.rpartition("-")[0].rpartition(".") for folder in kept)
    return bool(numba.config.DISABLE_JIT) or any(
        _folder(module, kernel) in kept for module, _, kernel in names
    )


def _opened(folder: Path | None) -> Path:
    """Make a folder of code, note that it is used, and remove those that are not.

    Raises:
        OSError: It cannot be made, or what it holds may be another user's.
        RuntimeError: There is no folder.
    """
    if folder is None:
        raise RuntimeError("a kernel was defined outside of a module's source file")
    _ROOT.mkdir(mode=0o700, parents=True, exist_ok=True)
    _check_own(_ROOT, 0o022)
    new = not folder.exists()
    folder.mkdir(mode=0o700, exist_ok=True)
    # Numba's own files and folders have the user's usual mode, so others may not even reach them.
    _check_own(folder, 0o077)
    for inside in folder.rglob("*"):
        # Another process of the user may be replacing it.
        with contextlib.suppress(FileNotFoundError):
            _check_own(inside, 0)
    os.utime(folder)
    for other in _ROOT.iterdir() if new else ():
        with contextlib.suppress(FileNotFoundError):
            if folder.stat().st_mtime - other.stat().st_mtime > _KEPT_FOR:
                shutil.rmtree(other, ignore_errors=True)
    return folder


def _check_own(path: Path, forbidden: int) -> None:
    """Refuse what may not be this user's: code is executed as it is found.

    Args:
        path: Of a folder or a file.
        forbidden: Bits that its mode may not have.

    Raises:
        PermissionError: It is a link, of another user, or open to others.
    """
    found = path.lstat()
    if stat.S_ISLNK(found.st_mode):
        raise PermissionError(f"{path} is a link, which is not followed")
    if found.st_uid != os.geteuid() or found.st_mode & forbidden:
        raise PermissionError(f"{path} belongs to another user, or others may write to it")


def _folder(module: str, name: str) -> Path | None:
    """Return where the code of a function belongs, or None if its source is not known."""
    if name not in _statements(module):
        return None
    reached: dict[tuple[str, str], str] = {}
    waiting = [(module, name)]
    while waiting:
        if (place := waiting.pop()) not in reached:
            reached[place], used = _definition(*place)
            waiting.extend(used)
    content = repr((numba.__version__, np.__version__, sorted(reached.items())))
    return _ROOT / f"{module}.{name}-{hashlib.sha256(content.encode()).hexdigest()[:16]}"


@functools.cache
def _definition(module: str, name: str) -> tuple[str, list[tuple[str, str]]]:
    """Return what defines a name of a module, and the (module, name) that it uses."""
    if name not in _statements(module):
        # Of a module that was imported, everything.
        whole = f"{module}.{name}".strip(".")
        return "", [(whole, other) for other in _statements(whole)]
    text, used = "", list[tuple[str, str]]()
    for node in _statements(module)[name]:
        if isinstance(node, ast.Import | ast.ImportFrom):
            source = str(getattr(node, "module", ""))
            used += [(source, alias.name) for alias in node.names if name == _local(alias)]
        else:
            text += ast.dump(node)
            names = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
            used += [(module, other) for other in names & _statements(module).keys()]
    return text, used


@functools.cache
def _statements(module: str) -> dict[str, list[ast.stmt]]:
    """Return the statements of a module of ours by the names that they bind, without docstrings."""
    source = ""
    if module.partition(".")[0] not in _LIBRARIES:
        with contextlib.suppress(ImportError, ValueError):
            source = str(getattr(importlib.util.find_spec(module), "origin", ""))
    tree = ast.parse(Path(source).read_bytes() if source.endswith(".py") else "")
    bound: dict[str, list[ast.stmt]] = {}
    waiting: list[Any] = [tree]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = {_local(alias) for alias in node.names}
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            names = {node.name}
        elif isinstance(node, ast.Module | ast.If | ast.Try | ast.ExceptHandler):
            waiting.extend(ast.iter_child_nodes(node))
            names = set()
        else:
            names = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
        for name in names:
            bound.setdefault(name, []).append(node)
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and ast.get_docstring(node) is not None:
            del node.body[0]
    return bound


def _local(alias: ast.alias) -> str:
    return alias.asname or alias.name.partition(".")[0]
