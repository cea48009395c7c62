"""MCAP storage: small chunks, each with its CRC, each handed to the disk as soon as it is full."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from winding_recorder.bags.channel import Channel
from winding_recorder.bags.sink import Sink

# Readers seek to the beginning of a chunk, and a killed recorder loses the open one.
CHUNK_BYTES = 256 * 1024
COMPRESSIONS = ("none", "zstd")
NOTES_BEFORE = "winding_run"
NOTES_AFTER = "winding_recording"
_LIBRARY = "cable-winding-twin"
_SCHEMA_ENCODING, _MESSAGE_ENCODING = "ros2msg", "cdr"
_MESSAGE_OVERHEAD = 9 + 22
_RECORD_OVERHEAD = 64


@dataclass(frozen=True, kw_only=True)
class BagConfig:
    """How a recording is stored.

    Attributes:
        compression: Of the chunks, "none" or "zstd".
        split_bytes: A file that has become so long is followed by a new one; 0 for one file.
        chunk_bytes: Longest chunk; a longer message has a chunk of its own.
    """

    compression: str = "none"
    split_bytes: int = 0
    chunk_bytes: int = CHUNK_BYTES

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
        from winding_recorder.bags.mcap_stream import McapStream  # noqa: PLC0415

        self._chunk_bytes = config.chunk_bytes
        self._sink = Sink(path)
        self._writer = McapStream(
            self._sink,
            profile="ros2",
            library=_LIBRARY,
            compression="" if config.compression == "none" else config.compression,
        )
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

    def write(self, channel: int, stamp_ns: int, data: bytes, sequence: int) -> bool:
        """Take a message; its stamp [ns] is both log and publish time.

        Returns:
            Whether the chunk before it was stored.

        Raises:
            OSError: The chunk before it could not be stored.
        """
        size = len(data) + _MESSAGE_OVERHEAD
        full = self._messages > 0 and self._open_bytes + size > self._chunk_bytes
        try:
            if full:
                self.flush()
        finally:
            self._open_bytes += size
            self._messages += 1
            self._writer.add_message(self._channels[channel], stamp_ns, data, sequence & 0xFFFFFFFF)
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

    def close(self, metadata: str, notes: Mapping[str, str]) -> None:
        """Write the summary and close.

        Args:
            metadata: The file's metadata.yaml, which rosbag2 keeps inside the file as well.
            notes: What is known of the recording now that it has ended.

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
        self._sink.close()

    def _register(self, channel: Channel) -> int:
        if channel.type_name not in self._schemas:
            definition = channel.definition.encode()
            self._schemas[channel.type_name] = self._writer.register_schema(
                channel.type_name, _SCHEMA_ENCODING, definition
            )
            self._describe(len(definition) + len(channel.type_name))
        qos = channel.profiles_text
        self._describe(len(channel.name) + len(qos) + len(channel.type_hash))
        return self._writer.register_channel(
            channel.name,
            _MESSAGE_ENCODING,
            self._schemas[channel.type_name],
            {"offered_qos_profiles": qos, "topic_type_hash": channel.type_hash},
        )

    def _describe(self, size: int) -> None:
        self._described_bytes += size + 2 * _RECORD_OVERHEAD
        self._open_bytes += size + 2 * _RECORD_OVERHEAD
