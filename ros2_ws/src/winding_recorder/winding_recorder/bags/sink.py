"""A file that takes what it is given whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path


class Sink:
    """Collects bytes and stores them together; a store that fails leaves no half of them.

    After a failure the bytes are still there, so that `flush` can be tried again once there is
    room.
    """

    def __init__(self, path: Path) -> None:
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        self._pending = bytearray()
        self._stored = 0

    @property
    def stored(self) -> int:
        """Bytes that the operating system has."""
        return self._stored

    @property
    def pending(self) -> int:
        """Bytes that wait for the next flush."""
        return len(self._pending)

    def write(self, data: bytes | bytearray | memoryview) -> int:
        """Take bytes; nothing is stored yet."""
        self._pending += data
        return len(data)

    def tell(self) -> int:
        """Return the position behind everything taken."""
        return self._stored + len(self._pending)

    def flush(self) -> None:
        """Hand everything to the operating system.

        Raises:
            OSError: There is no room; the file is as long as before.
        """
        offset = self._stored
        with memoryview(self._pending) as pending:
            try:
                while offset < self._stored + len(pending):
                    offset += os.pwrite(self._descriptor, pending[offset - self._stored :], offset)
            except OSError:
                os.ftruncate(self._descriptor, self._stored)
                raise
        self._stored = offset
        self._pending.clear()

    def abandon(self) -> None:
        """Close without storing what is left."""
        os.close(self._descriptor)

    def close(self) -> None:
        """Store what is left and close.

        Raises:
            OSError: There is no room; the file ends with the last flush that succeeded.
        """
        try:
            self.flush()
            os.fsync(self._descriptor)
        finally:
            os.close(self._descriptor)
