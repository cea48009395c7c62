"""A message of which only the stamp changes, or a number or two besides."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from winding_ros.stamps import STAMP, STAMP_AT, stamp_parts
from winding_ros.wire.cdr import HEADER_BYTES, serialised


@dataclass(frozen=True)
class Template:
    """The bytes of a message, filled in again and again, by several threads if need be.

    Attributes:
        data: CDR bytes of the message as it is, except for what is filled in.
    """

    data: bytes

    @classmethod
    def of(cls, message: Any) -> Template:
        """Return the template of a message that begins with its stamp."""
        return cls(serialised(message))

    def stamped(self, t: float) -> bytearray:
        """Return a copy with the stamp t [s], to write numbers into at known offsets."""
        copy = bytearray(self.data)
        STAMP.pack_into(copy, STAMP_AT, *stamp_parts(t))
        return copy


def number_at(without: bytes, with_number: bytes, size: int) -> int:
    """Return the offset of the one number of a size [bytes] in which two messages differ.

    Raises:
        ValueError: They do not differ.
    """
    for offset, (one, other) in enumerate(zip(without, with_number, strict=True)):
        if one != other:
            return offset - (offset - HEADER_BYTES) % size
    raise ValueError("the messages do not differ")
