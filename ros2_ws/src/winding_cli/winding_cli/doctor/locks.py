"""Whether a living process holds a file's lock."""

from __future__ import annotations

import fcntl
from pathlib import Path


def is_held(path: Path) -> bool:
    """Return whether another process holds the exclusive lock of a file.

    Raises:
        OSError: The file cannot be opened, or has gone.
    """
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False
