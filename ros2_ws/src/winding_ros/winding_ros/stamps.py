"""Stamps: seconds of simulated time in cores, builtin_interfaces/Time on topics."""

from __future__ import annotations

import math
import struct

from builtin_interfaces.msg import Time

from winding_ros.message_guard import StampError

_NANO = 1_000_000_000
_CDR_HEADER = 4
# Every stamped message starts with its stamp, right behind the CDR encapsulation header.
_STAMP = {0: struct.Struct(">iI"), 1: struct.Struct("<iI")}


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


def serialised_stamp(data: bytes) -> float:
    """Return the stamp [s] of a serialised message, the number that `decode_stamp` gives.

    Raises:
        StampError: The data is too short to hold a stamp.
    """
    if len(data) < _CDR_HEADER + 8:
        raise StampError(f"a stamped message has at least 12 bytes, got {len(data)}")
    seconds, nanoseconds = _STAMP[data[1] & 1].unpack_from(data, _CDR_HEADER)
    return float(seconds) + 1.0e-9 * float(nanoseconds)


def serialised_stamp_ns(data: bytes) -> int:
    """Return the stamp [ns] of a serialised message that starts with a stamp or a header.

    Raises:
        StampError: The data is too short to hold a stamp.
    """
    if len(data) < _CDR_HEADER + 8:
        raise StampError(f"a stamped message has at least 12 bytes, got {len(data)}")
    seconds, nanoseconds = _STAMP[data[1] & 1].unpack_from(data, _CDR_HEADER)
    return int(seconds) * _NANO + int(nanoseconds)


def stamp_bytes_of(stamp_ns: int) -> bytes:
    """Return a stamp [ns] as it stands in a serialised message of this project."""
    return _STAMP[1].pack(*divmod(stamp_ns, _NANO))


def stamp_bytes(data: bytes) -> bytes:
    """Return the stamp of a serialised message as it stands there."""
    return data[_CDR_HEADER : _CDR_HEADER + 8]


def stampless(data: bytes) -> bytes:
    """Return what follows the stamp of a serialised message."""
    return data[_CDR_HEADER + 8 :]


def with_stamp(data: bytes, stamp: bytes) -> bytes:
    """Return a serialised message with another stamp, of the same byte order."""
    return b"".join((data[:_CDR_HEADER], stamp, stampless(data)))
