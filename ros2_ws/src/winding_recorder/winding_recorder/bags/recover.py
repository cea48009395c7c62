"""Make a readable recording out of MCAP files that were cut off or damaged."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from mcap.records import Message
from rosbags.rosbag2.metadata import parse_qos

from winding_recorder.bags.description import COMPLETE, RECOVERED, BagError, Channel, StoredMessage
from winding_recorder.bags.mcap_file import NOTES_BEFORE, BagConfig
from winding_recorder.bags.mcap_scan import Scan, ScannedChunk, scan, scan_by_index
from winding_recorder.bags.reading import read_notes, storage_files
from winding_recorder.bags.writer import BagWriter

_Row = tuple[int, StoredMessage]  # (channel key within the file, message)


@dataclass(kw_only=True)
class Salvage:
    """What became of one file."""

    name: str  # The file
    kept: int = 0  # Messages kept
    bytes: int = 0  # Length of the file
    losses: list[str] = field(default_factory=list)  # What could not be kept, one sentence each


def recover(source: Path, target: Path) -> list[Salvage]:
    """Write everything that can be read of a recording into a new one.

    Every whole chunk is kept. The source is only read.

    Args:
        source: A rosbag2 folder, or one MCAP file.
        target: New folder.

    Raises:
        BagError: There is nothing to recover, a file is not MCAP, or the target exists.
        OSError: The target cannot be written.
    """
    files = storage_files(source)
    if target.exists():
        raise BagError(f"{target} exists already; a recording is never overwritten")
    if foreign := [file.name for file in files if file.suffix != ".mcap"]:
        raise BagError(
            f"only MCAP files are recovered, {foreign[0]} is none; `sqlite3 {foreign[0]} .recover` "
            "reads a damaged database"
        )
    parts = [_Part(file) for file in files]
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
        refused: list[BagError] = []
        for key, message in part.rows():
            if key in index:
                try:
                    writer.write(index[key], message)
                except BagError as error:
                    refused.append(error)
                else:
                    part.salvage.kept += 1
        if refused:
            part.salvage.losses.append(
                f"{part.salvage.name}: {len(refused)} messages that no recording can hold, the "
                f"first {refused[0]}"
            )
    losses = [loss for part in parts for loss in part.salvage.losses]
    ended = notes.get(COMPLETE, "no: the recorder was killed")
    writer.close(
        {RECOVERED: source.name, COMPLETE: ended if not losses else f"no: {'; '.join(losses)}"}
    )
    return [part.salvage for part in parts]


class _Part:
    """One file; the index leads past damage, without it the chunks are read in a row."""

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
            yield from map(_row, chunk.messages)
        yield from map(_row, result.loose)

    def _chunks(self, result: Scan) -> Iterator[ScannedChunk]:
        indexed = scan_by_index(self._path, result)
        return scan(self._path, result) if indexed is None else indexed


def _row(message: Message) -> _Row:
    return message.channel_id, StoredMessage(
        message.data, message.log_time, message.publish_time, message.sequence
    )
