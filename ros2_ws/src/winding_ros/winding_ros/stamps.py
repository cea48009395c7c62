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


def encode_stamp(t: float) -> Time:
    """Return the message stamp of a time [s]."""
    # Whole seconds first: a time since the epoch in nanoseconds has no room in a float.
    seconds = math.floor(t)
    carry, nanoseconds = divmod(round((t - seconds) * _NANO), _NANO)
    return Time(sec=seconds + carry, nanosec=nanoseconds)


def decode_stamp(stamp: Time) -> float:
    """Return the time [s] of a message stamp."""
    return float(stamp.sec) + 1.0e-9 * float(stamp.nanosec)


def serialised_stamp_ns(data: bytes) -> int:
    """Return the stamp [ns] of a serialised message that starts with a stamp or a header.

    Raises:
        StampError: The data is too short to hold a stamp.
    """
    if len(data) < _CDR_HEADER + 8:
        raise StampError(f"a stamped message has at least 12 bytes, got {len(data)}")
    seconds, nanoseconds = _STAMP[data[1] & 1].unpack_from(data, _CDR_HEADER)
    return int(seconds) * _NANO + int(nanoseconds)
