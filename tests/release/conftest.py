"""Two builds of the last commit, and programs that must end well."""

import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

from processes import ran

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True, kw_only=True)
class Build:
    """What one clone's build left."""

    clone: Path  # The clone
    archive: Path  # The source archive
    wheel: Path  # The wheel


def succeed(words: Sequence[object], cwd: Path, *, umask: int = -1, **variables: str) -> str:
    """Return what a program prints; it must end well."""
    ended = ran(*words, cwd=cwd, env={**os.environ, **variables}, umask=umask)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout


def build(clone: Path, *, umask: int, zone: str) -> Build:
    """Build a clone of the last commit under a mode mask and a time zone."""
    succeed(["git", "clone", "--quiet", ROOT, clone], clone.parent, umask=umask)
    # What an earlier build or an editor leaves is no part of a release.
    (clone / "ros2_ws" / "src" / "winding_core" / "winding_core" / "left_over.py").touch()
    succeed([clone / "release" / "build.sh", sys.executable, "dist"], clone, umask=umask, TZ=zone)
    (archive,), (wheel,) = (clone / "dist").glob("*.tar.gz"), (clone / "dist").glob("*.whl")
    return Build(clone=clone, archive=archive, wheel=wheel)


@pytest.fixture(scope="session")
def first_build(tmp_path_factory: pytest.TempPathFactory) -> Build:
    if not (ROOT / ".git").exists():
        pytest.skip("releases are built from a git clone")
    return build(tmp_path_factory.mktemp("release") / "one", umask=0o022, zone="UTC")


@pytest.fixture(scope="session")
def builds(first_build: Build, tmp_path_factory: pytest.TempPathFactory) -> tuple[Build, Build]:
    """Return two builds of one commit: other folder, second, mode mask and time zone."""
    began = int(time.time())
    while int(time.time()) == began:
        time.sleep(0.05)
    folder = tmp_path_factory.mktemp("elsewhere")
    return first_build, build(folder / "two", umask=0o002, zone="Asia/Tokyo")


@pytest.fixture(scope="session")
def run() -> Callable[..., str]:
    """Run a program that must end well, and return what it prints."""
    return succeed
