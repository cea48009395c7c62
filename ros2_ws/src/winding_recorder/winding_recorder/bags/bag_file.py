"""What the two kinds of storage files have in common, and the choices for them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

# Readers seek to the beginning of a chunk, and a killed recorder loses the open one.
CHUNK_BYTES = 256 * 1024
STORAGES = ("mcap", "sqlite3")
COMPRESSIONS = ("none", "zstd")


@dataclass(frozen=True, kw_only=True)
class BagConfig:
    """How a recording is stored.

    Attributes:
        storage: "mcap" or "sqlite3".
        compression: Of MCAP chunks, "none" or "zstd".
        split_bytes: A file that has become so long is followed by a new one; 0 for one file.
        chunk_bytes: Longest chunk or transaction; a longer message has a chunk of its own.
    """

    storage: str = "mcap"
    compression: str = "none"
    split_bytes: int = 0
    chunk_bytes: int = CHUNK_BYTES

    def __post_init__(self) -> None:
        if self.storage not in STORAGES:
            raise ValueError(f"storage must be one of {', '.join(STORAGES)}, got {self.storage!r}")
        if self.compression not in COMPRESSIONS:
            raise ValueError(
                f"compression must be one of {', '.join(COMPRESSIONS)}, got {self.compression!r}"
            )
        if self.storage == "sqlite3" and self.compression != "none":
            raise ValueError("sqlite3 storage has no compression; choose none, or mcap storage")
        if self.split_bytes < 0:
            raise ValueError(f"split size must not be negative, got {self.split_bytes} bytes")
        if self.chunk_bytes < 1:
            raise ValueError(f"chunk size must be positive, got {self.chunk_bytes} bytes")


class BagFile(Protocol):
    """One storage file of a recording.

    A `write` or `flush` that raises OSError keeps what could not be stored, so that it can be
    tried again when there is room.
    """

    path: Path

    @property
    def stored(self) -> int:
        """Bytes on the disk."""

    @property
    def tail_bytes(self) -> int:
        """Upper bound of what `close` will add."""

    def write(self, channel: int, stamp_ns: int, data: bytes, sequence: int) -> None:
        """Take a message of the channel with that index."""

    def flush(self) -> None:
        """End the open chunk or transaction and store it."""

    def close(self, metadata: str, notes: Mapping[str, str]) -> str:
        """Store everything and close; return the file's SHA-256."""
