"""Stamps: seconds of simulated time in cores, builtin_interfaces/Time on topics."""

import math
import struct

from builtin_interfaces.msg import Time

from winding_ros.message_guard import StampError

_NANO = 1_000_000_000
# Every stamped message starts with its stamp, right behind the CDR encapsulation header.
STAMP_AT = 4
STAMP = struct.Struct("<iI")
_STAMPS = {0: struct.Struct(">iI"), 1: STAMP}
_BEHIND = STAMP_AT + STAMP.size


def stamp_parts(t: float) -> tuple[int, int]:
    """Return the whole seconds and nanoseconds of a time [s]."""
    # Whole seconds first: a time since the epoch in nanoseconds has no room in a float.
    seconds = math.floor(t)
    carry, nanoseconds = divmod(round((t - seconds) * _NANO), _NANO)
    return seconds + carry, nanoseconds


def encode_stamp(t: float) -> Time:
    """Return the message stamp of a time [s]."""
    seconds, nanoseconds = stamp_parts(t)
    return Time(sec=seconds, nanosec=nanoseconds)


def decode_stamp(stamp: Time) -> float:
    """Return the time [s] of a message stamp."""
    return float(stamp.sec) + 1.0e-9 * float(stamp.nanosec)


def is_stamped(type_: type) -> bool:
    """Return whether messages of a type begin with a stamp or a header."""
    fields = list(type_.get_fields_and_field_types().values())  # type: ignore[attr-defined]
    return bool(fields) and fields[0] in ("std_msgs/Header", "builtin_interfaces/Time")


def serialised_stamp(data: bytes) -> float:
    """Return the stamp [s] of a serialised message, the number that `decode_stamp` gives.

    Raises:
        StampError: The data is too short to hold a stamp.
    """
    seconds, nanoseconds = _serialised_parts(data)
    return float(seconds) + 1.0e-9 * float(nanoseconds)


def serialised_stamp_ns(data: bytes) -> int:
    """Return the stamp [ns] of a serialised message that starts with a stamp or a header.

    Raises:
        StampError: The data is too short to hold a stamp.
    """
    seconds, nanoseconds = _serialised_parts(data)
    return seconds * _NANO + nanoseconds


def _serialised_parts(data: bytes) -> tuple[int, int]:
    if len(data) < _BEHIND:
        raise StampError(f"a stamped message has at least {_BEHIND} bytes, got {len(data)}")
    seconds, nanoseconds = _STAMPS[data[1] & 1].unpack_from(data, STAMP_AT)
    return seconds, nanoseconds


def stamp_bytes_of(stamp_ns: int) -> bytes:
    """Return a stamp [ns] as it stands in a serialised message of this project."""
    return STAMP.pack(*divmod(stamp_ns, _NANO))


def stamp_bytes(data: bytes) -> bytes:
    """Return the stamp of a serialised message as it stands there."""
    return data[STAMP_AT:_BEHIND]


def stampless(data: bytes) -> bytes:
    """Return what follows the stamp of a serialised message."""
    return data[_BEHIND:]


def with_stamp(data: bytes, stamp: bytes) -> bytes:
    """Return a serialised message with another stamp, of the same byte order."""
    return b"".join((data[:STAMP_AT], stamp, stampless(data)))
