"""A message of which only the stamp changes, or a number or two besides."""

from __future__ import annotations

import struct
from typing import Any

from winding_ros.stamps import stamp_parts
from winding_ros.wire.cdr import HEADER_BYTES, serialised

# Every stamped message, and a Clock, begins with its stamp.
STAMP = struct.Struct("<iI")
STAMP_AT = HEADER_BYTES


class Template:
    """The bytes of a message, to be filled in and sent again and again.

    Args:
        message: As it is, except for what is filled in.

    Attributes:
        buffer: To write numbers into, at offsets that are known from elsewhere.
    """

    def __init__(self, message: Any) -> None:
        self.buffer = bytearray(serialised(message))

    def stamped(self, t: float) -> bytes:
        """Return the message with the stamp t [s]."""
        STAMP.pack_into(self.buffer, STAMP_AT, *stamp_parts(t))
        return bytes(self.buffer)


def number_at(without: bytes, with_number: bytes, size: int) -> int:
    """Return the offset of the one number of a size [bytes] in which two messages differ.

    Raises:
        ValueError: They do not differ.
    """
    for offset, (one, other) in enumerate(zip(without, with_number, strict=True)):
        if one != other:
            return offset - (offset - HEADER_BYTES) % size
    raise ValueError("the messages do not differ")
