"""Room on the disk that is kept for ending a recording properly when the disk is full."""

from __future__ import annotations

import os
from pathlib import Path

_STEP = 128 * 1024


class Reserve:
    """A file of zeros beside the recording; releasing it makes room for index and metadata."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._held = 0
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)

    def hold(self, size: int) -> None:
        """Keep at least so many bytes.

        Raises:
            OSError: There is no room for them.
        """
        if size > self._held:
            wanted = -(-size // _STEP) * _STEP
            os.posix_fallocate(self._descriptor, self._held, wanted - self._held)
            self._held = wanted

    def release(self) -> None:
        """Give the room back; may be called again."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1
            self._path.unlink()
