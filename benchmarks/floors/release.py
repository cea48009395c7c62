"""The release before this one, as git has it, unpacked beside the tests' other leftovers."""

from __future__ import annotations

import io
import subprocess
import tarfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
# Tags first. Without them 0.1.0 is the tree at the end of the work that its changelog tells of.
TAGS = ("v0.1.0", "0.1.0", "v0.1", "0.1")
COMMIT = "400a7f590d961cbe82caee05f9a32cfdd42f0873"


def _git(*words: str) -> bytes | None:
    """Return what git prints, None where it fails or is not installed."""
    try:
        return subprocess.run(
            ["git", "-C", str(ROOT), *words], check=True, capture_output=True
        ).stdout
    except (OSError, subprocess.CalledProcessError):
        return None


def release_before() -> str | None:
    """Return the commit of the release before, None where the history does not reach it."""
    for name in (*TAGS, COMMIT):
        found = _git("rev-parse", "--verify", "--quiet", f"{name}^{{commit}}")
        if found is not None:
            return found.decode().strip()
    return None


def unpacked(commit: str, folder: Path) -> Path:
    """Return a folder with the sources of a commit, which may be there already.

    Kernels' machine code stays beside them, so that a later session does not compile it again.

    Args:
        commit: Of this repository.
        folder: Where the sources of each commit have a folder of their own.
    """
    target = folder / commit
    if not target.is_dir():
        archive = _git("archive", commit, "ros2_ws/src")
        assert archive is not None
        draft = folder / f"{commit}.part"
        with tarfile.open(fileobj=io.BytesIO(archive)) as sources:
            sources.extractall(draft, filter="data")
        draft.rename(target)
    return target
