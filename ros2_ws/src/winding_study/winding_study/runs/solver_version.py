"""Which solver computed a run: a digest of the sources that a prediction uses."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import cable_fem_node
import winding_core

# Where a prediction begins; all else is found by following imports.
ENTRIES = ("cable_fem_node.winding.prediction", "cable_fem_node.winding.solid_winding")

FOLDERS = {
    package.__name__: Path(str(package.__file__)).parent
    for package in (cable_fem_node, winding_core)
}


def solver_sources() -> dict[str, Path]:
    """Return the modules that decide a run's numbers, with their files, in order of names."""
    found: dict[str, Path] = {}
    waiting = list(ENTRIES)
    while waiting:
        name = waiting.pop()
        path = _file(name)
        if path is not None and name not in found:
            found[name] = path
            waiting += _imported(path)
    return dict(sorted(found.items()))


def _imported(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def _file(name: str) -> Path | None:
    package, *rest = name.split(".")
    if package not in FOLDERS:
        return None
    place = FOLDERS[package].joinpath(*rest)
    candidates = (place.with_suffix(".py"), place / "__init__.py")
    return next((path for path in candidates if path.is_file()), None)


@cache
def solver_version() -> str:
    """Return 16 digits that change when the solver's sources change, the same on every machine.

    Versions of NumPy and Numba do not count: they move results by rounding only.
    """
    digest = hashlib.sha256()
    for name, path in solver_sources().items():
        digest.update(f"{name}\0".encode())
        digest.update(path.read_bytes().replace(b"\r\n", b"\n") + b"\0")
    return digest.hexdigest()[:16]
