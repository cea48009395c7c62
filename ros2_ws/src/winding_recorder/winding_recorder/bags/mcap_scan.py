"""Go through an MCAP file record by record, however much of it there is."""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

from mcap.reader import make_reader
from mcap.records import Channel, Chunk, ChunkIndex, DataEnd, Footer, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from winding_recorder.bags.description import reason

_FOOTER_BYTES = 9 + 20 + 8
_CHUNK_OPCODE = 6
_RECORD_HEADER = struct.Struct("<BQ")


@dataclass(kw_only=True)
class ScannedChunk:
    """One chunk."""

    offset: int  # Of its record [bytes]
    # Schemas, channels and messages, in order; empty if it is damaged.
    records: list[Any] = field(default_factory=list)
    damage: str = ""  # What is wrong with it, or an empty text
    checked: bool = True  # Whether it has a CRC

    @property
    def messages(self) -> list[Message]:
        """Messages of the chunk."""
        return [record for record in self.records if isinstance(record, Message)]


@dataclass(kw_only=True)
class Scan:
    """What a pass over a file found outside its chunks; complete when the pass is over.

    Attributes:
        summary: Chunk indexes and message count of the summary, if there is one.
    """

    end: int = 0  # Where the last whole record ends [bytes]
    damage: str = ""  # Why the pass ended before the end magic, or an empty text
    finished: bool = False  # Whether the footer was reached
    data_checked: bool = False  # Whether the data section has a CRC
    indexes: list[ChunkIndex] = field(default_factory=list)
    schemas: dict[int, Schema] = field(default_factory=dict)  # By id, from wherever they stand
    channels: dict[int, Channel] = field(default_factory=dict)  # By id, from wherever they stand
    notes: dict[str, dict[str, str]] = field(default_factory=dict)  # Metadata records by name
    loose: list[Message] = field(default_factory=list)  # Messages outside chunks


def scan(path: Path, result: Scan) -> Iterator[ScannedChunk]:
    """Yield every chunk from the beginning up to the first byte that is no record.

    A chunk whose CRC is wrong is yielded as damaged, and the pass goes on behind it.

    Args:
        path: The file.
        result: Filled on the way.
    """
    with path.open("rb") as file:
        size = path.stat().st_size
        reader = StreamReader(file, emit_chunks=True, validate_crcs=True, record_size_limit=size)
        try:
            for record in reader.records:
                if isinstance(record, Chunk):
                    content = len(record.compression) + len(record.data)
                    length = _RECORD_HEADER.size + 32 + 8 + content
                    yield _opened(record, file.tell() - length, result)
                else:
                    _note(record, result)
                result.end = file.tell()
        except Exception as error:  # noqa: BLE001 - damaged bytes raise whatever they hit
            result.damage = reason(error)


def scan_by_index(path: Path, result: Scan) -> Iterator[ScannedChunk] | None:
    """Return the chunks that the summary lists, or None when there is no readable summary.

    The index finds chunks behind a damaged one whose length is wrong.
    """
    try:
        with path.open("rb") as file:
            summary = make_reader(file).get_summary()
        if summary is None or not summary.chunk_indexes:
            return None
    except Exception:  # noqa: BLE001 - damaged bytes raise whatever they hit
        return None
    result.schemas |= summary.schemas
    result.channels |= summary.channels
    result.indexes = sorted(summary.chunk_indexes, key=lambda index: index.chunk_start_offset)
    return _indexed(path, result)


def summary_damage(path: Path) -> str:
    """Return how footer or CRC contradict the summary, or an empty text."""
    with path.open("rb") as file:
        size = path.stat().st_size
        if size < _FOOTER_BYTES:
            return "the file is too short for a footer"
        file.seek(size - _FOOTER_BYTES)
        footer = file.read(_FOOTER_BYTES)
        start, _, crc = struct.unpack_from("<QQI", footer, 9)
        if crc == 0:
            return ""
        if not 0 < start < size:
            return f"the footer places the summary at byte {start} of {size}"
        file.seek(start)
        covered = file.read(size - _FOOTER_BYTES - start) + footer[: 9 + 16]
    return "" if zlib.crc32(covered) == crc else "the CRC of the summary is wrong"


def _indexed(path: Path, result: Scan) -> Iterator[ScannedChunk]:
    with path.open("rb") as file:
        for index in result.indexes:
            try:
                chunk = _chunk_at(file, index)
            except Exception as error:  # noqa: BLE001 - as above
                yield ScannedChunk(offset=index.chunk_start_offset, damage=reason(error))
            else:
                yield _opened(chunk, index.chunk_start_offset, result)
        result.finished = True


def _chunk_at(file: BinaryIO, index: ChunkIndex) -> Chunk:
    file.seek(index.chunk_start_offset)
    opcode, length = _RECORD_HEADER.unpack(file.read(_RECORD_HEADER.size))
    wanted = index.chunk_length - _RECORD_HEADER.size
    if opcode != _CHUNK_OPCODE or length != wanted:
        raise ValueError(f"there is no chunk of {wanted} bytes at byte {index.chunk_start_offset}")
    file.seek(index.chunk_start_offset)
    reader = StreamReader(file, skip_magic=True, emit_chunks=True, record_size_limit=length)
    chunk = next(iter(reader.records))
    if not isinstance(chunk, Chunk):
        raise ValueError(f"there is no chunk at byte {index.chunk_start_offset}")
    return chunk


def _opened(chunk: Chunk, offset: int, result: Scan) -> ScannedChunk:
    try:
        records = breakup_chunk(chunk, validate_crc=True)
    except Exception as error:  # noqa: BLE001 - as above
        return ScannedChunk(offset=offset, damage=reason(error))
    for record in records:
        _note(record, result, inside=True)
    return ScannedChunk(offset=offset, records=records, checked=chunk.uncompressed_crc != 0)


def _note(record: Any, result: Scan, *, inside: bool = False) -> None:
    if isinstance(record, Schema):
        result.schemas[record.id] = record
    elif isinstance(record, Channel):
        result.channels[record.id] = record
    elif isinstance(record, Metadata):
        result.notes[record.name] = record.metadata
    elif isinstance(record, ChunkIndex):
        result.indexes.append(record)
    elif isinstance(record, DataEnd):
        result.data_checked = record.data_section_crc != 0
    elif isinstance(record, Footer):
        result.finished = True
    elif isinstance(record, Message) and not inside:
        result.loose.append(record)
