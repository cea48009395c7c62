"""When the messages of each topic arrived, by the indexes of storage files."""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from mcap.reader import make_reader

# Opcode and length of a record, channel, bytes of the entries behind it.
_HEAD = struct.Struct("<BQHI")
_ENTRY = np.dtype([("time", "<u8"), ("offset", "<u8")])


def arrivals(files: Iterable[Path]) -> dict[str, tuple[int, int]]:
    """Return the first and the last bag time [ns] of each topic that has messages.

    Args:
        files: Storage files of one recording; what their indexes state is believed.
    """
    spans: dict[str, tuple[int, int]] = {}
    for file in files:
        for topic, first, last in _mcap(file) if file.suffix == ".mcap" else _sqlite(file):
            before = spans.get(topic, (first, last))
            spans[topic] = (min(before[0], first), max(before[1], last))
    return spans


def _mcap(path: Path) -> Iterator[tuple[str, int, int]]:
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


def _sqlite(path: Path) -> Iterator[tuple[str, int, int]]:
    connection = sqlite3.connect(f"file:{path}?mode=ro", uri=True)
    try:
        yield from connection.execute(
            "SELECT topics.name, MIN(timestamp), MAX(timestamp) FROM messages JOIN topics "
            "ON topics.id = messages.topic_id GROUP BY topics.name"
        )
    finally:
        connection.close()
