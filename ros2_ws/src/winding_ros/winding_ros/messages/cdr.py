"""Plain little-endian CDR (OMG DDSI-RTPS 2.5, 10.2), written with zeros between the fields.

Fast CDR leaves what was in memory there: equal messages differ, and recordings hold scraps of it.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

from winding_ros.messages.stamps import STAMP, STAMP_AT, stamp_parts

# Representation identifier of plain little-endian CDR, and no options.
ENCAPSULATION = b"\x00\x01\x00\x00"
HEADER_BYTES = len(ENCAPSULATION)
# How many items a sequence has.
COUNT = struct.Struct("<I")
_CODES = {
    "boolean": "?",
    "octet": "B",
    "uint8": "B",
    "int8": "b",
    "uint16": "H",
    "int16": "h",
    "uint32": "I",
    "int32": "i",
    "uint64": "Q",
    "int64": "q",
    "float": "f",
    "double": "d",
}
_MANY = re.compile(r"sequence<(.+?)(?:, \d+)?>|(.+)\[(\d+)\]")


class CdrError(ValueError):
    """Bytes are not laid out as plain little-endian CDR."""


def serialised(message: Any) -> bytes:
    """Return the CDR bytes of a message, unless it is bytes; equal messages give equal bytes."""
    if isinstance(message, bytes):
        return message
    buffer = bytearray(ENCAPSULATION)
    _write_fields(buffer, message)
    return bytes(buffer)


def _write_fields(buffer: bytearray, message: Any) -> None:
    for name, type_ in message.get_fields_and_field_types().items():
        _write(buffer, getattr(message, name), type_)


def _write(buffer: bytearray, value: Any, type_: str) -> None:
    code = _CODES.get(type_)
    many = _MANY.fullmatch(type_)
    if code is not None:
        _align(buffer, struct.calcsize(code))
        buffer += value if isinstance(value, bytes) else struct.pack(f"<{code}", value)
    elif type_.startswith("string"):
        data = value.encode() + b"\0"
        _write(buffer, len(data), "uint32")
        buffer += data
    elif many is not None:
        item = many[1] or many[2]
        if many[1]:
            _write(buffer, len(value), "uint32")
        _write_items(buffer, value, item)
    else:
        _write_fields(buffer, value)


def _write_items(buffer: bytearray, values: Any, type_: str) -> None:
    code = _CODES.get(type_)
    if "/" in type_ and len(values) > 0:
        kinds = values[0].get_fields_and_field_types()
        # A line has some hundred points.
        if set(kinds.values()) == {"double"}:
            values = [getattr(value, name) for value in values for name in kinds]
            code = "d"
    if code is None or type_ == "octet":
        for value in values:
            _write(buffer, value, type_)
        return
    items = np.asarray(values, dtype=f"<{code}")
    if items.size:
        _align(buffer, items.itemsize)
        buffer += items.tobytes()


def _align(buffer: bytearray, size: int) -> None:
    buffer += bytes((HEADER_BYTES - len(buffer)) % size)


class CdrReader:
    """Walks through the fields of a message.

    Raises:
        CdrError: The bytes are of another representation.
    """

    def __init__(self, data: bytes) -> None:
        if data[:2] != ENCAPSULATION[:2]:
            raise CdrError("the message is not plain little-endian CDR")
        self.data = data
        self.offset = HEADER_BYTES  # Of the next byte

    def skip(self, size: int, count: int = 1) -> int:
        """Pass primitives of a size [bytes]; return where they begin.

        Raises:
            CdrError: The message ends too early.
        """
        begin = self.offset + (HEADER_BYTES - self.offset) % size
        self.offset = begin + size * count
        if self.offset > len(self.data):
            raise CdrError(f"the message ends after {len(self.data)} bytes")
        return begin

    def u32(self) -> int:
        """Return an unsigned integer."""
        return int(COUNT.unpack_from(self.data, self.skip(4))[0])

    def string(self) -> str:
        """Return a string."""
        size = self.u32()
        begin = self.skip(1, size)
        return self.data[begin : begin + max(size - 1, 0)].decode(errors="replace")

    def octets(self) -> memoryview:
        """Return a sequence of bytes."""
        size = self.u32()
        begin = self.skip(1, size)
        return memoryview(self.data)[begin : self.offset]

    def doubles(self) -> tuple[int, int]:
        """Pass a sequence of float64; return where its items begin and how many they are."""
        count = self.u32()
        return (self.skip(8, count), count) if count else (self.offset, 0)


@dataclass(frozen=True)
class Template:
    """The bytes of a message, filled in again and again, by several threads if need be."""

    data: bytes  # CDR bytes of the message as it is, except for what is filled in.

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
