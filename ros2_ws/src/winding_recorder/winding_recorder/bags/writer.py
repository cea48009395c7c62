"""A rosbag2 folder that is being written."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from winding_recorder.bags.description import (
    METADATA,
    BagError,
    Channel,
    Description,
    Extent,
    StoredMessage,
    inner_text,
)
from winding_recorder.bags.mcap_file import BagConfig, McapFile

_RESERVE = ".reserve"
_RESERVE_STEP = 128 * 1024
_FOLDER_BYTES = 64 * 1024  # metadata.yaml with its notes


class Reserve:
    """A file of zeros beside the recording; releasing it makes room for index and metadata."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._held = 0
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)

    def hold(self, size: int) -> None:
        """Keep at least so many bytes.

        Raises:
            OSError: There is no room for them.
        """
        if size > self._held:
            wanted = -(-size // _RESERVE_STEP) * _RESERVE_STEP
            os.posix_fallocate(self._descriptor, self._held, wanted - self._held)
            self._held = wanted

    def release(self) -> None:
        """Give the room back; may be called again."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1
            self._path.unlink(missing_ok=True)


class BagWriter:
    """Writes messages into a new folder, file by file.

    Room for the end is kept from the beginning: when the disk is full, `close` still makes a
    readable recording of everything that was taken.

    Args:
        folder: It must not exist yet.
        channels: Topics, by the index that `write` names.
        config: How to store.
        notes: What is known of the run, by name.

    Raises:
        BagError: The folder exists.
        OSError: It cannot be made, or the disk is full.
    """

    def __init__(
        self,
        folder: Path,
        channels: Sequence[Channel],
        config: BagConfig,
        notes: Mapping[str, str] | None = None,
    ) -> None:
        if folder.exists():
            raise BagError(f"{folder} exists already; a recording is never overwritten")
        folder.mkdir(parents=True)
        self.folder = folder
        self._channels = tuple(channels)
        self._config = config
        self._notes = dict(notes or {})
        self._extents: list[Extent] = []
        self._stored_before = 0
        self._reserve = Reserve(folder / _RESERVE)
        self._hold(0)
        self._file = self._next_file()
        self._hold(self._file.tail_bytes)

    @property
    def stored(self) -> int:
        """Bytes on the disk."""
        return self._stored_before + (0 if self._ended else self._file.stored)

    @property
    def present(self) -> bool:
        """Whether the file that is being written, or was last, is still in its place."""
        return (self.folder / self._extents[-1].path).exists()

    @property
    def taken(self) -> int:
        """Messages taken so far."""
        return sum(sum(extent.counts) for extent in self._extents)

    def write(self, channel: int, message: StoredMessage) -> None:
        """Take a message.

        Raises:
            BagError: It has a time that no recording can hold; it is left out.
            OSError: The disk is full or broken. The message is taken all the same; `close` now.
        """
        # Half of a message would spoil the chunk.
        message.check()
        self._extents[-1].add(channel, message.arrived_ns)
        if self._file.write(channel, message):
            self._hold(self._file.tail_bytes)
            if 0 < self._config.split_bytes <= self._file.stored:
                self._split()

    def flush(self) -> None:
        """Store everything that was taken.

        Raises:
            OSError: As in `write`.
        """
        self._file.flush()
        self._hold(self._file.tail_bytes)

    def close(self, notes: Mapping[str, str] | None = None) -> None:
        """Store everything, and describe the folder.

        Args:
            notes: What is known of the recording now that it has ended.

        Raises:
            OSError: Even the reserve was not enough; `winding bag recover` reads what there is.
        """
        self._notes |= notes or {}
        self._reserve.release()
        if not self._ended:
            self._end_file(sync=True)
        text = self._described(self._extents).text()
        # Half a description would hide the files that are whole.
        draft = self.folder / f".{METADATA}"
        try:
            draft.write_text(text, encoding="utf-8")
            draft.replace(self.folder / METADATA)
        finally:
            draft.unlink(missing_ok=True)

    def _next_file(self) -> McapFile:
        path = self.folder / f"{self.folder.name}_{len(self._extents)}.mcap"
        file = McapFile(path, self._channels, self._config, self._notes)
        self._extents.append(Extent(path=path.name, counts=[0] * len(self._channels)))
        self._ended = False
        return file

    def _split(self) -> None:
        self._file.flush()
        self._reserve.release()
        # What waits behind the messages of a further file must not wait for the disk.
        self._end_file(sync=False)
        self._stored_before += self._file.stored
        self._reserve = Reserve(self.folder / _RESERVE)
        self._hold(0)
        self._file = self._next_file()

    def _end_file(self, *, sync: bool) -> None:
        self._ended = True
        own = inner_text(self._described(self._extents[-1:]))
        self._file.close(own, self._notes, sync=sync)

    def _described(self, extents: Sequence[Extent]) -> Description:
        return Description(channels=self._channels, extents=extents, notes=self._notes)

    def _hold(self, tail_bytes: int) -> None:
        notes = sum(len(name) + len(text) for name, text in self._notes.items())
        self._reserve.hold(tail_bytes + self._config.chunk_bytes + _FOLDER_BYTES + 4 * notes)
