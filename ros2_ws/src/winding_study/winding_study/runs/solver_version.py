"""Which solver computed a run: a digest of the sources that a prediction may use."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

import cable_fem_node
import winding_core

PACKAGES = (cable_fem_node, winding_core)
# Neither the adapter to ROS nor the verification problems decide a run's numbers.
_OUTSIDE = {"ros", "verification", "node.py", "__main__.py"}


def solver_sources() -> dict[str, Path]:
    """Return the files that may decide a run's numbers, by place in their package, in order."""
    return {
        f"{package.__name__}/{path.relative_to(folder).as_posix()}": path
        for package in PACKAGES
        for folder in [Path(str(package.__file__)).parent]
        for path in sorted(folder.rglob("*.py"))
        if path.relative_to(folder).parts[0] not in _OUTSIDE
    }


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
