"""SQLite storage (rosbag2's schema 4): one transaction per batch, a kill loses one batch."""

from __future__ import annotations

import errno
import hashlib
import sqlite3
from collections.abc import Mapping, Sequence
from pathlib import Path

from winding_recorder.bags.bag_file import BagConfig
from winding_recorder.bags.channel import Channel

_SCHEMA = """
CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);
CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL,
    metadata TEXT NOT NULL);
CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
    serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL,
    type_description_hash TEXT NOT NULL);
CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL,
    encoding TEXT NOT NULL, encoded_message_definition TEXT NOT NULL,
    type_description_hash TEXT NOT NULL);
CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,
    timestamp INTEGER NOT NULL, data BLOB NOT NULL);
CREATE INDEX timestamp_idx ON messages (timestamp ASC);
INSERT INTO schema(schema_version, ros_distro) VALUES (4, 'jazzy');
"""
_METADATA_VERSION = 9


class SqliteFile:
    """One SQLite file.

    The rollback journal keeps whole transactions when the process is killed; only power loss
    could break the file, because the disk is not waited for before the end.

    Args:
        path: New file.
        channels: Topics, by the index that `write` names.
        config: Size of a transaction.
        notes: Unused; SQLite storage has its notes in metadata.yaml only.
    """

    def __init__(
        self, path: Path, channels: Sequence[Channel], config: BagConfig, notes: Mapping[str, str]
    ) -> None:
        self.path = path
        self._batch_bytes = config.chunk_bytes
        self._batch: list[tuple[int, int, bytes]] = []
        self._open_bytes = 0
        self._connection = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
        self._connection.execute("PRAGMA journal_mode=TRUNCATE")
        self._connection.execute("PRAGMA synchronous=OFF")
        try:
            self._connection.executescript(_SCHEMA)
            self._describe(channels)
        except sqlite3.Error as error:
            raise _as_os_error(error) from error

    @property
    def stored(self) -> int:
        """Bytes on the disk."""
        return self.path.stat().st_size

    @property
    def tail_bytes(self) -> int:
        """Upper bound of the open transaction with its pages, index entries and journal."""
        return 2 * self._open_bytes + 64 * len(self._batch) + 64 * 1024

    def write(self, channel: int, stamp_ns: int, data: bytes, sequence: int) -> None:
        """Take a message with its stamp [ns]; the schema has no place for its sequence number.

        Raises:
            OSError: The transaction before it could not be stored.
        """
        if self._batch and self._open_bytes + len(data) > self._batch_bytes:
            try:
                self.flush()
            finally:
                self._take(channel, stamp_ns, data)
        else:
            self._take(channel, stamp_ns, data)

    def flush(self) -> None:
        """Store the open transaction.

        Raises:
            OSError: There is no room; the next `flush` tries again.
        """
        if not self._batch:
            return
        try:
            self._connection.execute("BEGIN")
            self._connection.executemany(
                "INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", self._batch
            )
            self._connection.execute("COMMIT")
        except sqlite3.Error as error:
            # A full disk has rolled back by itself in some of the cases.
            if self._connection.in_transaction:
                self._connection.execute("ROLLBACK")
            raise _as_os_error(error) from error
        self._batch.clear()
        self._open_bytes = 0

    def close(self, metadata: str, notes: Mapping[str, str]) -> str:
        """Store everything and close; return the file's SHA-256.

        Raises:
            OSError: There is no room.
        """
        try:
            self.flush()
            self._connection.execute(
                "INSERT INTO metadata(metadata_version, metadata) VALUES (?, ?)",
                (_METADATA_VERSION, metadata),
            )
            self._connection.execute("PRAGMA journal_mode=DELETE")
        except sqlite3.Error as error:
            raise _as_os_error(error) from error
        finally:
            self._connection.close()
        with self.path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()

    def _take(self, channel: int, stamp_ns: int, data: bytes) -> None:
        self._batch.append((channel + 1, stamp_ns, data))
        self._open_bytes += len(data)

    def _describe(self, channels: Sequence[Channel]) -> None:
        types = {channel.type_name: channel for channel in channels}
        self._connection.executemany(
            "INSERT INTO message_definitions(topic_type, encoding, encoded_message_definition, "
            "type_description_hash) VALUES (?, 'ros2msg', ?, ?)",
            [(name, channel.definition, channel.type_hash) for name, channel in types.items()],
        )
        self._connection.executemany(
            "INSERT INTO topics(name, type, serialization_format, offered_qos_profiles, "
            "type_description_hash) VALUES (?, ?, 'cdr', ?, ?)",
            [
                (channel.name, channel.type_name, channel.profiles_text, channel.type_hash)
                for channel in channels
            ],
        )


def _as_os_error(error: sqlite3.Error) -> OSError:
    full = getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_FULL
    return OSError(errno.ENOSPC if full else errno.EIO, str(error))
