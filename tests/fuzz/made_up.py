"""What made-up messages are made of, and how they travel."""

import sqlite3
from array import array
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from hypothesis import settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message

from winding_ros.messages.serialised import MessageError

fuzzed = settings.get_profile("quick")
any_float = st.floats(allow_nan=True, allow_infinity=True)
number = st.floats(allow_nan=False, allow_infinity=False)
small = st.integers(0, 40)
uint32 = st.one_of(small, st.integers(0, 2**32 - 1))
words = st.text(st.characters(min_codepoint=32, exclude_categories=["Cs"]), max_size=12)
AXES = ("cylinder_angle", "angular_speed", "carriage_position", "feed_speed")
# What comes back exactly from whole nanoseconds.
stamps = st.integers(-(2**20), 2**20).map(lambda k: k / 2.0)


def taken(decode: Callable[[Any], Any], message: Any) -> Any:
    """Return what a decoder makes of a message, or None when it refuses it."""
    try:
        return decode(message)
    except MessageError:
        return None


def data_of(most: int) -> st.SearchStrategy[Any]:
    """Return the data of messages of at most so many bytes."""
    return st.binary(max_size=most).map(lambda content: array("B", content))


def wired(message: Any, type_: type | None = None) -> Any:
    """Return a message, or one of a type in CDR bytes, as it arrives at the other end."""
    data = message if isinstance(message, bytes) else serialize_message(message)
    return deserialize_message(data, type_ or type(message))


def write_database(
    file: Path,
    *,
    topics: Sequence[tuple[Any, ...]] = (),
    types: Sequence[tuple[Any, ...]] = (),
    messages: Sequence[tuple[Any, ...]] = (),
    dropped: str = "",
) -> None:
    """Write a recording in SQLite with rows that hold anything: columns without types take it."""
    connection = sqlite3.connect(file)
    connection.executescript(
        "CREATE TABLE schema(schema_version, ros_distro);"
        "CREATE TABLE metadata(id, metadata_version, metadata);"
        "CREATE TABLE topics(id, name, type, serialization_format, offered_qos_profiles,"
        " type_description_hash);"
        "CREATE TABLE message_definitions(id, topic_type, encoding, encoded_message_definition,"
        " type_description_hash);"
        "CREATE TABLE messages(id, topic_id, timestamp, data);"
        "INSERT INTO schema VALUES (4, 'jazzy');"
    )
    for table, rows in (("topics", topics), ("message_definitions", types), ("messages", messages)):
        for row in rows:
            connection.execute(f"INSERT INTO {table} VALUES ({', '.join('?' * len(row))})", row)
    if dropped:
        connection.execute(f"DROP TABLE {dropped}")
    connection.commit()
    connection.close()
