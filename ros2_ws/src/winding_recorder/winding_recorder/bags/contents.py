"""What a recording holds, without reading its messages."""

import json
import sqlite3
import struct
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from winding_core.parameters import build, declared_in
from winding_recorder.bags.description import LOST, PARAMETERS, BagError, reason
from winding_recorder.bags.reading import opened, read_notes, storage_files

Configuration = TypeVar("Configuration")
# Opcode and length of a record, channel, bytes of the entries behind it.
_HEAD = struct.Struct("<BQHI")
_ENTRY = np.dtype([("time", "<u8"), ("offset", "<u8")])


@dataclass(frozen=True, kw_only=True)
class TopicContent:
    """One topic of a recording."""

    name: str  # Full topic name
    type_name: str  # Its type
    messages: int  # How many there are
    lost: int | None  # Messages that never reached the recorder; None where they were not counted
    rate: float | None  # Arrivals per second from its first message to its last; None below two


@dataclass(frozen=True, kw_only=True)
class Content:
    """A recording."""

    start: float  # First arrival [s], since the epoch; in older recordings the first stamp
    duration: float  # Length [s]
    files: Mapping[str, int]  # Storage files with their sizes [bytes]
    topics: tuple[TopicContent, ...]  # By name
    notes: Mapping[str, str]  # Texts beside the messages


def contents(path: Path) -> Content:
    """Return what a recording states about itself.

    Raises:
        BagError: It cannot be read.
    """
    notes = read_notes(path) if path.is_dir() else {}
    files = {file.name: file.stat().st_size for file in storage_files(path)}
    with opened(path) as reader:
        try:
            return _content(reader, files, notes, _arrivals(storage_files(path)))
        except Exception as error:
            # Times and counts are used only here, and damaged ones raise whatever they hit.
            raise BagError(f"cannot read {path}: {reason(error)}") from error


def _content(
    reader: AnyReader,
    files: Mapping[str, int],
    notes: Mapping[str, str],
    spans: Mapping[str, tuple[int, int]],
) -> Content:
    empty = reader.message_count == 0
    return Content(
        start=0.0 if empty else reader.start_time * 1e-9,
        # Readers count the end one nanosecond behind the last message.
        duration=0.0 if empty else (reader.duration - 1) * 1e-9,
        files=files,
        topics=tuple(
            TopicContent(
                name=link.topic,
                type_name=link.msgtype,
                messages=link.msgcount,
                lost=_count(notes.get(f"{LOST}{link.topic}")),
                rate=_rate(link.msgcount, spans.get(link.topic)),
            )
            for link in sorted(reader.connections, key=lambda link: link.topic)
        ),
        notes=notes,
    )


def _arrivals(files: Iterable[Path]) -> dict[str, tuple[int, int]]:
    """Return the first and the last bag time [ns] of each topic that has messages.

    Args:
        files: Storage files of one recording; their indexes are taken as they are.
    """
    spans: dict[str, tuple[int, int]] = {}
    for file in files:
        for topic, first, last in (
            _mcap_arrivals(file) if file.suffix == ".mcap" else _sqlite_arrivals(file)
        ):
            before = spans.get(topic, (first, last))
            spans[topic] = (min(before[0], first), max(before[1], last))
    return spans


def _mcap_arrivals(path: Path) -> Iterator[tuple[str, int, int]]:
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
        chunks = [] if summary is None else summary.chunk_indexes
        chunks = sorted(chunks, key=lambda chunk: chunk.chunk_start_offset)
        for key, channel in () if summary is None else summary.channels.items():
            offsets = [offset for c in chunks if (offset := c.message_index_offsets.get(key))]
            # Chunks follow each other as messages arrived.
            for offset in offsets[:1] + offsets[-1:]:
                file.seek(offset)
                *_, size = _HEAD.unpack(file.read(_HEAD.size))
                times = np.frombuffer(file.read(size), dtype=_ENTRY)["time"]
                if times.size:
                    yield channel.topic, int(times.min()), int(times.max())


def _sqlite_arrivals(path: Path) -> Iterator[tuple[str, int, int]]:
    connection = sqlite3.connect(f"file:{path}?mode=ro", uri=True)
    try:
        yield from connection.execute(
            "SELECT topics.name, MIN(timestamp), MAX(timestamp) FROM messages JOIN topics "
            "ON topics.id = messages.topic_id GROUP BY topics.name"
        )
    finally:
        connection.close()


def _rate(messages: int, span: tuple[int, int] | None) -> float | None:
    if messages < 2 or span is None or span[1] <= span[0]:
        return None
    return (messages - 1) / ((span[1] - span[0]) * 1e-9)


def _count(text: str | None) -> int | None:
    return int(text) if text is not None and text.isdecimal() else None


def recorded_parameters(path: Path, node: str) -> dict[str, Any]:
    """Return the parameters that a recording states of a node.

    Raises:
        BagError: It states none.
    """
    text = read_notes(path).get(f"{PARAMETERS}{node}") if path.is_dir() else None
    if text is None:
        raise BagError(f"{path} does not say with what parameters {node} ran")
    try:
        values = json.loads(text)
    except json.JSONDecodeError as error:
        raise BagError(f"the parameters of {node} in {path} are not JSON: {error}") from error
    if not isinstance(values, dict):
        raise BagError(f"the parameters of {node} in {path} are no mapping")
    return values


def configuration_of(
    declared: type[Configuration], values: Mapping[str, Any], node: str
) -> Configuration:
    """Return a node's configuration from recorded parameters.

    rclpy's own parameters, use_sim_time among them, do not change the work and are left out.

    Raises:
        ParameterError: A value is refused.
    """
    return build(declared, declared_in(declared, values), owner=node)
