"""Machine code on disk: never of other sources, shared by checkouts of the same ones."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from winding_core.kernel_cache import _KEPT_FOR, _opened

INNER = """
from winding_core.compiling import compiled

FACTOR = {factor}


@compiled
def scaled(x):
    return FACTOR * x
"""
OUTER = """
from kernels.inner import scaled
from winding_core.compiling import compiled


@compiled
def outer(x):
    return scaled(x) + 1.0
"""
ASK = """
from kernels.deeper.outer import outer

print(outer(10.0), sum(outer.stats.cache_hits.values()))
"""


def checkout(folder: Path, factor: int) -> Path:
    """Make a checkout whose kernel inlines one of another file."""
    package = folder / "kernels"
    (package / "deeper").mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "inner.py").write_text(INNER.format(factor=factor), encoding="utf-8")
    (package / "deeper" / "outer.py").write_text(OUTER, encoding="utf-8")
    return folder


def asked(folder: Path, cache: Path) -> tuple[float, int]:
    """Return (outer(10), whether its code came from disk) of a process of a checkout."""
    path = os.pathsep.join([str(folder), *sys.path])
    environment = {**os.environ, "PYTHONPATH": path, "NUMBA_CACHE_DIR": str(cache)}
    done = subprocess.run(
        [sys.executable, "-c", ASK], env=environment, capture_output=True, text=True, check=True
    )
    value, hits = done.stdout.split()
    return float(value), int(hits)


@pytest.mark.slow
def test_code_of_other_sources_is_never_used(tmp_path: Path) -> None:
    here, cache = checkout(tmp_path / "here", 2), tmp_path / "cache"
    assert asked(here, cache) == (21.0, 0)
    inner = here / "kernels" / "inner.py"
    before = inner.stat()
    inner.write_text(INNER.format(factor=3), encoding="utf-8")
    # As old and as long as before, and not the file that holds the asked function.
    os.utime(inner, ns=(before.st_atime_ns, before.st_mtime_ns))
    # Python itself compares only these two.
    shutil.rmtree(here / "kernels" / "__pycache__", ignore_errors=True)
    assert asked(here, cache) == (31.0, 0)
    assert asked(checkout(tmp_path / "old", 2), cache) == (21.0, 1)


@pytest.mark.slow
def test_checkouts_of_the_same_sources_share_their_code(tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    assert asked(checkout(tmp_path / "one", 2), cache) == (21.0, 0)
    assert asked(checkout(tmp_path / "two", 2), cache) == (21.0, 1)
    assert asked(checkout(tmp_path / "other", 3), cache) == (31.0, 0)


def test_code_that_nobody_loads_any_more_is_deleted_when_other_code_is_made(
    tmp_path: Path,
) -> None:
    unused, used, stranger = (tmp_path / name for name in ("kernels-1", "kernels-2", "other-1"))
    for folder, months in ((unused, 1.1), (used, 0.9), (stranger, 1.1)):
        folder.mkdir()
        age = folder.stat().st_mtime - months * _KEPT_FOR
        os.utime(folder, (age, age))
    _opened(tmp_path / "kernels-3")
    assert not unused.exists()
    assert used.exists()
    assert stranger.exists()
