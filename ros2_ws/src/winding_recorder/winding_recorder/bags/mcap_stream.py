"""An MCAP file as it is written: chunks of messages with CRCs, indices, statistics and summary.

The library `mcap` describes every record; its writer makes an object and eight small writes of
each message, which takes ten times as long as the message's bytes do here. What is written is
byte by byte what that writer writes.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Mapping, Sequence
from itertools import chain

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from winding_recorder.bags.sink import Sink

_MAGIC = struct.pack("<8B", 137, 77, 67, 65, 80, 48, 13, 10)
# Opcode, length, channel, sequence, log time, publish time.
_MESSAGE = struct.Struct("<BQHIQQ")
# What a record's length counts of a message beside its data.
_MESSAGE_FIELDS = 22
# Opcode, length, channel, bytes of the pairs of log time and offset that follow.
_INDEX = struct.Struct("<BQHI")
_INDEX_FIELDS = 6
_FOOTER = struct.Struct("<BQQQ")
_FOOTER_BYTES = 8 + 8 + 4


class McapStream:
    """Writes the records of one MCAP file into a sink; only `flush` stores anything.

    Args:
        sink: Where to.
        profile: Of the file.
        library: Who writes.
        compression: Of chunks: "" or "zstd".
    """

    def __init__(self, sink: Sink, *, profile: str, library: str, compression: str = "") -> None:
        self._sink = sink
        self._compression = compression
        self._compress = _compressor(compression)
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._chunks: list[ChunkIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._first_ns: int | None = None
        self._last_ns = 0
        self._counts: dict[int, int] = {}
        self._crc = 0
        self._begin_chunk()
        self._put(_MAGIC)
        self._put(_bytes_of(Header(profile=profile, library=library)))

    def register_schema(self, name: str, encoding: str, definition: bytes) -> int:
        """Return the number of a new message definition."""
        schema = Schema(id=len(self._schemas) + 1, data=definition, encoding=encoding, name=name)
        self._schemas.append(schema)
        self._open += _bytes_of(schema)
        return int(schema.id)

    def register_channel(
        self, topic: str, encoding: str, schema: int, metadata: Mapping[str, str]
    ) -> int:
        """Return the number of a new channel."""
        channel = Channel(
            id=len(self._channels) + 1,
            topic=topic,
            message_encoding=encoding,
            schema_id=schema,
            metadata=dict(metadata),
        )
        self._channels.append(channel)
        self._open += _bytes_of(channel)
        return int(channel.id)

    def add_metadata(self, name: str, metadata: Mapping[str, str]) -> None:
        """Write notes beside the chunks."""
        record = _bytes_of(Metadata(name=name, metadata=dict(metadata)))
        index = MetadataIndex(offset=self._sink.tell(), length=len(record), name=name)
        self._metadata.append(index)
        self._put(record)

    def add_message(self, channel: int, stamp_ns: int, data: bytes, sequence: int) -> None:
        """Add a message to the open chunk; its stamp [ns] is both log and publish time."""
        chunk = self._open
        self._entries.setdefault(channel, []).append((stamp_ns, len(chunk)))
        chunk += _MESSAGE.pack(
            Opcode.MESSAGE,
            _MESSAGE_FIELDS + len(data),
            channel,
            sequence,
            stamp_ns,
            stamp_ns,
        )
        chunk += data

    def flush(self) -> None:
        """End the open chunk, if it has messages, and store everything.

        Raises:
            OSError: There is no room; the next `flush` tries again.
        """
        self._end_chunk()
        self._sink.flush()

    def finish(self) -> None:
        """End the open chunk and write the summary; nothing may be added any more."""
        self._end_chunk()
        self._put(_bytes_of(DataEnd(self._crc)))
        start = self._sink.tell()
        summary = bytearray()
        offsets: list[SummaryOffset] = []
        for opcode, records in self._summary():
            before = len(summary)
            for record in records:
                summary += _bytes_of(record)
            offsets.append(
                SummaryOffset(
                    group_opcode=opcode,
                    group_start=start + before,
                    group_length=len(summary) - before,
                )
            )
        offsets_start = start + len(summary)
        for offset in offsets:
            summary += _bytes_of(offset)
        footer = _FOOTER.pack(Opcode.FOOTER, _FOOTER_BYTES, start, offsets_start)
        crc = zlib.crc32(footer, zlib.crc32(summary))
        self._sink.write(summary)
        self._sink.write(_bytes_of(Footer(start, offsets_start, crc)))
        self._sink.write(_MAGIC)

    def _begin_chunk(self) -> None:
        self._open = bytearray()
        self._entries: dict[int, list[tuple[int, int]]] = {}

    def _end_chunk(self) -> None:
        if not self._entries:
            return
        entries, data = self._entries, self._open
        self._begin_chunk()
        stamps = [stamp for index in entries.values() for stamp, _ in index]
        first, last = min(stamps), max(stamps)
        self._first_ns = first if self._first_ns is None else min(self._first_ns, first)
        self._last_ns = max(self._last_ns, last)
        for channel, index in entries.items():
            self._counts[channel] = self._counts.get(channel, 0) + len(index)
        stored = self._compress(data)
        start = self._sink.tell()
        record = _bytes_of(
            Chunk(
                compression=self._compression,
                data=stored,
                message_start_time=first,
                message_end_time=last,
                uncompressed_crc=zlib.crc32(data),
                uncompressed_size=len(data),
            )
        )
        self._put(record)
        indices = bytearray()
        places: dict[int, int] = {}
        for channel, index in entries.items():
            places[channel] = start + len(record) + len(indices)
            indices += _INDEX.pack(
                Opcode.MESSAGE_INDEX, _INDEX_FIELDS + 16 * len(index), channel, 16 * len(index)
            )
            indices += struct.pack(f"<{2 * len(index)}Q", *chain.from_iterable(index))
        self._put(indices)
        self._chunks.append(
            ChunkIndex(
                message_start_time=first,
                message_end_time=last,
                chunk_start_offset=start,
                chunk_length=len(record),
                message_index_offsets=places,
                message_index_length=len(indices),
                compression=self._compression,
                compressed_size=len(stored),
                uncompressed_size=len(data),
            )
        )

    def _put(self, data: bytes | bytearray) -> None:
        self._crc = zlib.crc32(data, self._crc)
        self._sink.write(data)

    def _summary(self) -> Sequence[tuple[Opcode, Sequence[McapRecord]]]:
        statistics = Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            metadata_count=len(self._metadata),
            message_start_time=self._first_ns or 0,
            message_end_time=self._last_ns,
            schema_count=len(self._schemas),
        )
        return (
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.ATTACHMENT_INDEX, []),
            (Opcode.METADATA_INDEX, self._metadata),
        )


def _bytes_of(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())


def _compressor(compression: str) -> Callable[[bytearray], bytes | bytearray]:
    if not compression:
        return lambda data: data
    # A recording without compression needs no library for it.
    import zstandard  # noqa: PLC0415

    return zstandard.compress
