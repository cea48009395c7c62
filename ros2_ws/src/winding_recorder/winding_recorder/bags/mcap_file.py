"""MCAP storage: small chunks, each with its CRC, each handed to the disk as soon as it is full."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from winding_recorder.bags.description import Channel, StoredMessage

# Readers seek to the beginning of a chunk, and a killed recorder loses the open one.
CHUNK_BYTES = 256 * 1024
# The index of a file is kept in memory until it ends: 9 MB of a minute with pictures.
SPLIT_BYTES = 2_000_000_000
_NEVER_FULL = 2**62
COMPRESSIONS = ("none", "zstd")
NOTES_BEFORE = "winding_run"
NOTES_AFTER = "winding_recording"
_LIBRARY = "cable-winding-twin"
_SCHEMA_ENCODING, _MESSAGE_ENCODING = "ros2msg", "cdr"
_MESSAGE_OVERHEAD = 9 + 22
_RECORD_OVERHEAD = 64


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

    def close(self, *, sync: bool) -> None:
        """Store what is left and close.

        Args:
            sync: Whether to wait for the disk.

        Raises:
            OSError: There is no room; the file ends with the last flush that succeeded.
        """
        try:
            self.flush()
            if sync:
                os.fsync(self._descriptor)
        finally:
            os.close(self._descriptor)


@dataclass(frozen=True, kw_only=True)
class BagConfig:
    """How a recording is stored."""

    compression: str = "none"  # Of the chunks, "none" or "zstd"
    # A file that has become so long is followed by a new one; 0 for one file.
    split_bytes: int = SPLIT_BYTES
    chunk_bytes: int = CHUNK_BYTES  # Longest chunk; a longer message has a chunk of its own

    def __post_init__(self) -> None:
        if self.compression not in COMPRESSIONS:
            raise ValueError(
                f"compression must be one of {', '.join(COMPRESSIONS)}, got {self.compression!r}"
            )
        if self.split_bytes < 0:
            raise ValueError(f"split size must not be negative, got {self.split_bytes} bytes")
        if self.chunk_bytes < 1:
            raise ValueError(f"chunk size must be positive, got {self.chunk_bytes} bytes")


class McapFile:
    """One MCAP file of profile ros2.

    A `write` or `flush` that raises OSError keeps what could not be stored, so that it can be
    tried again when there is room.

    Args:
        path: New file.
        channels: Topics, by the index that `write` names.
        config: Compression and chunk size.
        notes: What is known of the run before it begins; stored at once.
    """

    def __init__(
        self, path: Path, channels: Sequence[Channel], config: BagConfig, notes: Mapping[str, str]
    ) -> None:
        # A run without a bag needs no MCAP.
        from mcap.writer import CompressionType, Writer  # noqa: PLC0415

        self._chunk_bytes = config.chunk_bytes
        self._sink = Sink(path)
        # Chunks end where `flush` ends them, which keeps what a full disk refused.
        self._writer = Writer(
            self._sink,
            chunk_size=_NEVER_FULL,
            compression=CompressionType[config.compression.upper()],
            enable_data_crcs=True,
        )
        self._writer.start(profile="ros2", library=_LIBRARY)
        self._writer.add_metadata(NOTES_BEFORE, dict(notes))
        self._schemas: dict[str, int] = {}
        self._open_bytes = self._described_bytes = 0
        self._chunks = self._messages = 0
        self._channels = [self._register(channel) for channel in channels]
        self._writer.flush()

    @property
    def stored(self) -> int:
        """Bytes on the disk."""
        return self._sink.stored

    @property
    def tail_bytes(self) -> int:
        """Upper bound of index, summary and footer, and of the open chunk."""
        index = (self._chunks + 1) * (2 * _RECORD_OVERHEAD + 10 * len(self._channels))
        return 2 * self._described_bytes + index + self._sink.pending + self._open_bytes

    def write(self, channel: int, message: StoredMessage) -> bool:
        """Take a message.

        Returns:
            Whether the chunk before it was stored.

        Raises:
            OSError: The chunk before it could not be stored.
        """
        size = len(message.data) + _MESSAGE_OVERHEAD
        full = self._messages > 0 and self._open_bytes + size > self._chunk_bytes
        try:
            if full:
                self.flush()
        finally:
            self._open_bytes += size
            self._messages += 1
            self._writer.add_message(
                self._channels[channel],
                message.arrived_ns,
                message.data,
                message.published_ns,
                message.sequence & 0xFFFFFFFF,
            )
        return full

    def flush(self) -> None:
        """End the open chunk and store it.

        Raises:
            OSError: There is no room; the next `flush` tries again.
        """
        if self._messages:
            # Counted first: a chunk that could not be stored is complete all the same.
            self._chunks += 1
            self._open_bytes = self._messages = 0
        self._writer.flush()

    def close(self, metadata: str, notes: Mapping[str, str], *, sync: bool) -> None:
        """Write the summary and close.

        Args:
            metadata: The file's metadata.yaml, which rosbag2 keeps inside the file as well.
            notes: What is known of the recording now that it has ended.
            sync: Whether to wait for the disk.

        Raises:
            OSError: There is no room.
        """
        try:
            self._writer.flush()
            self._writer.add_metadata("rosbag2", {"serialized_metadata": metadata})
            self._writer.add_metadata(NOTES_AFTER, dict(notes))
            self._writer.finish()
        except OSError:
            self._sink.abandon()
            raise
        self._sink.close(sync=sync)

    def _register(self, channel: Channel) -> int:
        if channel.type_name not in self._schemas:
            definition = channel.definition.encode()
            self._schemas[channel.type_name] = self._writer.register_schema(
                channel.type_name, _SCHEMA_ENCODING, definition
            )
            self._describe(len(definition) + len(channel.type_name))
        qos = channel.profiles_text
        self._describe(len(channel.name) + len(qos) + len(channel.type_hash))
        number: int = self._writer.register_channel(
            channel.name,
            _MESSAGE_ENCODING,
            self._schemas[channel.type_name],
            {"offered_qos_profiles": qos, "topic_type_hash": channel.type_hash},
        )
        return number

    def _describe(self, size: int) -> None:
        self._described_bytes += size + 2 * _RECORD_OVERHEAD
        self._open_bytes += size + 2 * _RECORD_OVERHEAD
