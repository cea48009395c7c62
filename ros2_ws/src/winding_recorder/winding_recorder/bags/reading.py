"""Open recordings with rosbags; one sentence for each that cannot be read."""

import struct
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from winding_recorder.bags.description import METADATA, BagError, reason

# libyaml's safe loader, where PyYAML was built with it, is ten times as fast.
LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
# What rmw's buffer is longer than the message, at most.
_SURPLUS = 4
STORAGE_SUFFIXES = (".mcap", ".db3")
# What a message begins with that has a stamp, behind the four bytes of the encapsulation.
_STAMPED = ("std_msgs/msg/Header", "builtin_interfaces/msg/Time")
_STAMPS = {0: struct.Struct(">4xiI"), 1: struct.Struct("<4xiI")}
_NANO = 1_000_000_000


@contextmanager
def opened(path: Path) -> Iterator[AnyReader]:
    """Yield a reader of a folder or of one storage file.

    Raises:
        BagError: It is damaged, or no recording at all.
    """
    if not path.exists():
        raise BagError(f"there is no recording at {path}")
    try:
        reader = AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY))
        reader.open()
    except FileNotFoundError as error:
        raise BagError(f"{path} has no {METADATA}; try `winding bag recover`") from error
    except Exception as error:
        # The reader has no closed list of what it raises on damaged bytes.
        raise BagError(f"cannot read {path}: {reason(error)}") from error
    try:
        for link in reader.connections:
            # A database has a value of any type in any column.
            if not (isinstance(link.topic, str) and link.topic.isprintable()):
                raise BagError(f"cannot read {path}: {link.topic!r} is no topic")
        yield reader
    finally:
        reader.close()


def messages_of(
    reader: AnyReader, links: Sequence[Any], start: int | None = None, stop: int | None = None
) -> Iterator[tuple[Any, int, bytes]]:
    """Yield (connection, bag time [ns], bytes) of every message, by bag time.

    Args:
        reader: Of the recording.
        links: Connections.
        start: First bag time [ns]; None for the beginning.
        stop: Bag time [ns] before which it ends; None for the end.

    Raises:
        BagError: The recording is damaged.
    """
    if not links:
        return
    messages = reader.messages(links, start=start, stop=stop)
    while True:
        try:
            link, stamp, data = next(messages)
        except StopIteration:
            return
        except Exception as error:
            raise BagError(f"cannot read on: {reason(error)}") from error
        if not isinstance(data, bytes | bytearray | memoryview):
            raise BagError(f"cannot read on: a message of {link.topic} is no bytes")
        yield link, stamp, bytes(data)


def stamped_messages(
    reader: AnyReader, links: Sequence[Any]
) -> Iterator[tuple[Any, int, int, bytes]]:
    """Yield (connection, own stamp [ns], bag time [ns], bytes) of every message, by bag time.

    A message without a stamp has its bag time in place of it. In recordings of before arrival
    times were recorded the bag time is the stamp.

    Raises:
        BagError: The recording is damaged.
    """
    stamped = {link.id for link in links if _begins_with_stamp(reader, link.msgtype)}
    for link, arrived, data in messages_of(reader, links):
        own = _stamp_of(data) if link.id in stamped else None
        yield link, arrived if own is None else own, arrived, data


def _begins_with_stamp(reader: AnyReader, type_name: str) -> bool:
    _, fields = reader.typestore.fielddefs.get(type_name, ((), ()))
    return bool(fields) and fields[0][1][1] in _STAMPED


def _stamp_of(data: bytes) -> int | None:
    """Return the stamp [ns] that a serialised message begins with; None where it has none."""
    layout = _STAMPS[data[1] & 1 if len(data) > 1 else 1]
    if len(data) < layout.size:
        return None
    seconds, nanoseconds = layout.unpack_from(data)
    return int(seconds * _NANO + nanoseconds) if nanoseconds < _NANO else None


def decoded(reader: AnyReader, link: Any, data: bytes) -> Any:
    """Return a message by the definition that the recording brings.

    Raises:
        BagError: The bytes are not a message of that type.
    """
    try:
        return reader.deserialize(data, link.msgtype)
    except Exception as error:
        raise BagError(f"{link.topic}: not a {link.msgtype}: {reason(error)}") from error


def storage_files(folder: Path) -> list[Path]:
    """Return the storage files of a recording in the order they were written.

    Raises:
        BagError: There are none.
    """
    if not folder.exists():
        raise BagError(f"there is no recording at {folder}")
    if folder.is_file():
        found = [folder] if folder.suffix in STORAGE_SUFFIXES else []
    else:
        found = [path for path in folder.iterdir() if path.suffix in STORAGE_SUFFIXES]
    if not found:
        raise BagError(f"{folder} holds no {' or '.join(STORAGE_SUFFIXES)} file")
    return sorted(found, key=_number)


def _number(path: Path) -> tuple[int, str]:
    digits = path.stem.rpartition("_")[2]
    return (int(digits) if digits.isdecimal() else 0, path.name)


def read_information(folder: Path) -> dict[str, Any]:
    """Return the mapping inside metadata.yaml.

    Raises:
        BagError: The file is missing, or is no such mapping.
    """
    try:
        content = yaml.load((folder / METADATA).read_text(encoding="utf-8"), LOADER)
        information = content["rosbag2_bagfile_information"]
        if not isinstance(information, dict):
            raise TypeError(f"it holds a {type(information).__name__}")
    except FileNotFoundError:
        raise BagError(f"{METADATA} is missing: the recording was not closed") from None
    except (OSError, yaml.YAMLError, KeyError, TypeError, ValueError, RecursionError) as error:
        raise BagError(f"{METADATA} cannot be read: {reason(error)}") from error
    return information


def read_notes(folder: Path) -> dict[str, str]:
    """Return the texts that a recording keeps beside its messages; none if they are unreadable."""
    try:
        notes = read_information(folder).get("custom_data")
    except BagError:
        return {}
    return {str(k): str(v) for k, v in notes.items()} if isinstance(notes, Mapping) else {}


class Decoder:
    """Deserialises messages by the definitions that a recording brings."""

    def __init__(self) -> None:
        self.types = get_typestore(Stores.ROS2_JAZZY)  # The typestore in use

    def learn(self, type_name: str, definition: str) -> None:
        """Take a type's definition, unless Jazzy has the type.

        Raises:
            BagError: The definition cannot be parsed.
        """
        if type_name in self.types.fielddefs:
            return
        try:
            parsed = get_types_from_msg(definition, type_name)
            self.types.register({k: v for k, v in parsed.items() if k not in self.types.fielddefs})
        except Exception as error:
            raise BagError(f"type {type_name} cannot be parsed: {reason(error)}") from error

    def decode(self, type_name: str, data: bytes) -> Any:
        """Return a message.

        Raises:
            BagError: The bytes are not a message of that type.
        """
        try:
            return self.types.deserialize_cdr(data, type_name)
        except Exception as error:
            raise BagError(f"not a {type_name}: {reason(error)}") from error

    def canonical(self, type_name: str, data: bytes) -> bytes:
        """Return a message's bytes with zeros between its fields and nothing behind them.

        rmw leaves in the gaps, and in up to four bytes behind the end, what was in memory: the
        same message has other bytes each time.

        Raises:
            BagError: The bytes are not a message of that type.
        """
        try:
            message = self.decode(type_name, data)
        except BagError:
            message = self.decode(type_name, data[:-_SURPLUS])
        return bytes(self.types.serialize_cdr(message, type_name))
