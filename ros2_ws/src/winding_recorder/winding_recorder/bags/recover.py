"""Make a readable recording out of one that was cut off or damaged."""

from __future__ import annotations

import shutil
import sqlite3
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from rosbags.rosbag2.metadata import parse_qos

from winding_recorder.bags.bag_file import BagConfig
from winding_recorder.bags.channel import Channel
from winding_recorder.bags.failure import BagError
from winding_recorder.bags.mcap_file import NOTES_BEFORE
from winding_recorder.bags.mcap_scan import Scan, ScannedChunk, scan, scan_by_index
from winding_recorder.bags.notes import COMPLETE, RECOVERED
from winding_recorder.bags.reading import read_notes, reason, storage_files
from winding_recorder.bags.writer import BagWriter

# (channel key within the file, stamp [ns], bytes, sequence number)
_Row = tuple[int, int, bytes, int]


@dataclass(kw_only=True)
class Salvage:
    """What became of one file.

    Attributes:
        name: The file.
        kept: Messages kept.
        bytes: Length of the file.
        losses: What could not be kept, one sentence each.
    """

    name: str
    kept: int = 0
    bytes: int = 0
    losses: list[str] = field(default_factory=list)


def recover(source: Path, target: Path) -> list[Salvage]:
    """Write everything that can be read of a recording into a new one.

    Every whole chunk (or transaction) is kept. The source is only read.

    Args:
        source: A rosbag2 folder, or one storage file.
        target: New folder.

    Raises:
        BagError: There is nothing to recover, or the target exists.
        OSError: The target cannot be written.
    """
    files = storage_files(source)
    if target.exists():
        raise BagError(f"{target} exists already; a recording is never overwritten")
    with tempfile.TemporaryDirectory(prefix="winding-recover-") as scratch:
        parts = [_part(file, Path(scratch)) for file in files]
        channels: dict[str, Channel] = {}
        for part in parts:
            for channel in part.channels.values():
                channels.setdefault(channel.name, channel)
        if not channels:
            why = "; ".join(loss for part in parts for loss in part.salvage.losses)
            raise BagError(f"{source} holds no whole chunk: {why or 'it is empty'}")
        names = list(channels)
        notes = {name: text for part in parts for name, text in part.notes.items()}
        notes |= read_notes(source) if source.is_dir() else {}
        writer = BagWriter(target, list(channels.values()), BagConfig(), notes)
        for part in parts:
            index = {key: names.index(channel.name) for key, channel in part.channels.items()}
            for key, stamp, data, sequence in part.rows():
                if key in index:
                    writer.write(index[key], stamp, data, sequence)
                    part.salvage.kept += 1
        losses = [loss for part in parts for loss in part.salvage.losses]
        ended = notes.get(COMPLETE, "no: the recorder was killed")
        writer.close(
            {
                RECOVERED: source.name,
                COMPLETE: ended if not losses else f"no: {'; '.join(losses)}",
            }
        )
    return [part.salvage for part in parts]


class _McapPart:
    """One MCAP file; the index leads past damage, without it the chunks are read in a row."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.salvage = Salvage(name=path.name, bytes=path.stat().st_size)
        result = Scan()
        for chunk in self._chunks(result):
            if chunk.damage:
                self.salvage.losses.append(
                    f"{path.name}: chunk at byte {chunk.offset}: {chunk.damage}"
                )
        if not result.finished:
            rest = self.salvage.bytes - result.end
            why = result.damage or "the end is missing"
            self.salvage.losses.append(
                f"{path.name}: the last {rest} bytes hold no whole record ({why})"
                if rest
                else f"{path.name}: it was not ended; a chunk that was still open is gone"
            )
        self.channels = {
            key: Channel(
                name=channel.topic,
                type_name=schema.name,
                definition=schema.data.decode("utf-8", errors="replace"),
                type_hash=channel.metadata.get("topic_type_hash", ""),
                qos=tuple(parse_qos(channel.metadata.get("offered_qos_profiles", ""))),
            )
            for key, channel in result.channels.items()
            if (schema := result.schemas.get(channel.schema_id)) is not None
        }
        self.notes = result.notes.get(NOTES_BEFORE, {})

    def rows(self) -> Iterator[_Row]:
        """Yield every message that can be read."""
        result = Scan()
        for chunk in self._chunks(result):
            for message in chunk.messages:
                yield message.channel_id, message.log_time, message.data, message.sequence
        for message in result.loose:
            yield message.channel_id, message.log_time, message.data, message.sequence

    def _chunks(self, result: Scan) -> Iterator[ScannedChunk]:
        indexed = scan_by_index(self._path, result)
        return scan(self._path, result) if indexed is None else indexed


class _SqlitePart:
    """One SQLite file, read from a copy: opening it may roll an open transaction back."""

    def __init__(self, path: Path, scratch: Path) -> None:
        self.salvage = Salvage(name=path.name, bytes=path.stat().st_size)
        self._path = scratch / path.name
        for suffix in ("", "-journal", "-wal"):
            beside = path.with_name(path.name + suffix)
            if beside.exists():
                shutil.copyfile(beside, scratch / beside.name)
        self.channels: dict[int, Channel] = {}
        self.notes: dict[str, str] = {}
        try:
            self._describe()
        except Exception as error:  # noqa: BLE001 - damaged bytes raise whatever they hit
            self.salvage.losses.append(f"{path.name}: {reason(error)}")

    def rows(self) -> Iterator[_Row]:
        """Yield every message that can be read."""
        connection = sqlite3.connect(self._path)
        strange = 0
        try:
            for key, stamp, data in connection.execute(
                "SELECT topic_id, timestamp, data FROM messages ORDER BY id"
            ):
                if isinstance(stamp, int) and stamp >= 0 and isinstance(data, bytes):
                    yield key, stamp, data, 0
                else:
                    strange += 1
        except (sqlite3.Error, UnicodeDecodeError) as error:
            self.salvage.losses.append(f"{self._path.name}: {reason(error)}")
        finally:
            connection.close()
        if strange:
            self.salvage.losses.append(f"{self._path.name}: {strange} rows hold no message")

    def _describe(self) -> None:
        connection = sqlite3.connect(self._path)
        try:
            definitions = dict(
                connection.execute(
                    "SELECT topic_type, encoded_message_definition FROM message_definitions"
                )
            )
            for key, name, kind, qos, digest in connection.execute(
                "SELECT id, name, type, offered_qos_profiles, type_description_hash FROM topics"
            ):
                if not (isinstance(name, str) and isinstance(kind, str)):
                    raise ValueError(f"topic {key} has no name or no type")
                self.channels[key] = Channel(
                    name=name,
                    type_name=kind,
                    definition=str(definitions.get(kind) or ""),
                    type_hash=str(digest or ""),
                    qos=tuple(parse_qos(str(qos or ""))),
                )
        finally:
            connection.close()


def _part(path: Path, scratch: Path) -> _McapPart | _SqlitePart:
    return _McapPart(path) if path.suffix == ".mcap" else _SqlitePart(path, scratch)


def is_whole(salvages: list[Salvage]) -> bool:
    """Return whether nothing was lost."""
    return not any(salvage.losses for salvage in salvages)
