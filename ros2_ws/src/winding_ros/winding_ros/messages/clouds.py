"""Structured NumPy records as PointCloud2, and back; the centreline as a line strip."""

import struct
from functools import cache
from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import Point
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from winding_ros.messages.cdr import COUNT, CdrReader, Template, number_at, serialised
from winding_ros.messages.rig import BASE_FRAME
from winding_ros.messages.serialised import MessageError, deserialised
from winding_ros.messages.stamps import decode_stamp, serialised_stamp

# row_step, and the number of bytes that follow.
_SIZES = struct.Struct("<II")
_DATATYPES = {
    "f4": PointField.FLOAT32,
    "f8": PointField.FLOAT64,
    "u4": PointField.UINT32,
    "i4": PointField.INT32,
}


def encode_cloud(t: float, records: NDArray[np.void]) -> bytes:
    """Return structured records, shape (n,), as the CDR bytes of a PointCloud2 stamped t [s].

    The field names, types and offsets are those of the records' dtype.
    """
    layout = _cloud_layout(records.dtype)
    count = len(records)
    data = _padded(records).tobytes()
    places = [name for name in ("x", "y", "z") if name in (records.dtype.names or ())]
    dense = all(bool(np.isfinite(records[name]).all()) for name in places)
    before = layout.before.stamped(t)
    COUNT.pack_into(before, layout.width_at, count)
    return b"".join(
        (before, _SIZES.pack(records.dtype.itemsize * count, len(data)), data, bytes([dense]))
    )


class _CloudLayout(NamedTuple):
    """What clouds of one dtype have in common: everything before row_step, and where width is."""

    before: Template
    width_at: int
    fixed: tuple[tuple[slice, bytes], ...]


@cache
def _cloud_layout(dtype: np.dtype[np.void]) -> _CloudLayout:
    fields = [
        PointField(name=name, offset=offset, datatype=_DATATYPES[of.str[1:]], count=1)
        for name, (of, offset, *_) in (dtype.fields or {}).items()
    ]
    message = PointCloud2(height=1, fields=fields, point_step=dtype.itemsize)
    message.header.frame_id = BASE_FRAME
    # An empty cloud ends with row_step, the number of its bytes and is_dense.
    before = Template(serialised(message)[: -_SIZES.size - 1])
    reader = CdrReader(before.data)
    reader.skip(4, 2)
    head = reader.offset
    reader.string()
    reader.skip(4)
    width_at = reader.skip(4)
    spans = (slice(head, width_at), slice(reader.offset, len(before.data)))
    return _CloudLayout(before, width_at, tuple((span, reader.data[span]) for span in spans))


def _padded(records: NDArray[np.void]) -> NDArray[np.void]:
    """Return a copy with zeros between the fields, where others leave what was in memory."""
    padded = np.zeros(records.shape, dtype=records.dtype)
    for name in records.dtype.names or ():
        padded[name] = records[name]
    return padded


def decode_cloud(
    message: bytes | PointCloud2, dtype: np.dtype[np.void]
) -> tuple[float, NDArray[np.void]]:
    """Return (t [s], records of the given dtype, shape (n,)) of a cloud or of its CDR bytes.

    Raises:
        MessageError: The cloud lacks a field of the dtype, has it with another type or outside
            its points, or has another number of bytes than it states.
    """
    if isinstance(message, bytes):
        records = _records(message, dtype)
        if records is not None:
            return serialised_stamp(message), records
        message = deserialised(message, PointCloud2)
    if message.is_bigendian:
        raise MessageError("point cloud must be little-endian")
    count = message.width * message.height
    raw = np.frombuffer(message.data, dtype=np.uint8)
    if raw.size != count * message.point_step:
        raise MessageError(
            f"point cloud of {count} points of {message.point_step} bytes needs "
            f"{count * message.point_step} bytes, got {raw.size}"
        )
    by_name = {field.name: field for field in message.fields}
    for name, (wanted, *_) in (dtype.fields or {}).items():
        field = by_name.get(name)
        if field is None or field.datatype != _DATATYPES[wanted.str[1:]]:
            raise MessageError(f"point cloud needs a field {name} of type {wanted.name}")
        if field.offset + wanted.itemsize > message.point_step:
            raise MessageError(
                f"field {name} at byte {field.offset} lies outside a point of "
                f"{message.point_step} bytes"
            )
    # A message may claim any number of points: memory is taken only for those it brings.
    records = np.zeros(count, dtype=dtype)
    table = raw.reshape(count, message.point_step)
    for name, (wanted, *_) in (dtype.fields or {}).items():
        offset = by_name[name].offset
        column = np.ascontiguousarray(table[:, offset : offset + wanted.itemsize])
        records[name] = column.view(wanted).reshape(-1)
    return decode_stamp(message.header.stamp), records


def _records(data: bytes, dtype: np.dtype[np.void]) -> NDArray[np.void] | None:
    """Return the records of a cloud that is laid out as `encode_cloud` does, or None."""
    layout = _cloud_layout(dtype)
    if any(data[span] != what for span, what in layout.fixed):
        return None
    begin = len(layout.before.data) + _SIZES.size
    if len(data) < begin:
        return None
    (count,) = COUNT.unpack_from(data, layout.width_at)
    row, size = _SIZES.unpack_from(data, begin - _SIZES.size)
    # Fast CDR rounds the length of a message up.
    if not row == size == count * dtype.itemsize < len(data) - begin:
        return None
    return np.frombuffer(data, dtype, count, begin).copy()


_SAMPLE = Point(x=1.25, y=2.5, z=5.0)


def encode_line_strip(t: float, points: NDArray[np.float64], width: float) -> bytes:
    """Return a centreline as an RViz line strip, in CDR bytes.

    Args:
        t: Stamp [s].
        points: At least one [m], shape (n, 3).
        width: Of the line [m].

    Raises:
        ValueError: There is no point.
    """
    if len(points) == 0:
        raise ValueError("a line strip needs points, got none")
    layout = _line_layout(float(width))
    before = layout.before.stamped(t)
    COUNT.pack_into(before, layout.count_at, len(points))
    return b"".join((before, np.asarray(points, dtype="<f8").tobytes(), layout.after))


class _LineLayout(NamedTuple):
    """What lines of one width have in common: before and after the points, and their number."""

    before: Template
    count_at: int
    after: bytes


@cache
def _line_layout(width: float) -> _LineLayout:
    one, two = (serialised(_line(width, count)) for count in (1, 2))
    sample = np.array([_SAMPLE.x, _SAMPLE.y, _SAMPLE.z], dtype="<f8").tobytes()
    begin = one.index(sample)
    count_at = number_at(one[:begin], two[:begin], COUNT.size)
    return _LineLayout(Template(one[:begin]), count_at, one[begin + len(sample) :])


def _line(width: float, count: int) -> Marker:
    message = Marker(ns="cable", id=0, type=Marker.LINE_STRIP, action=Marker.ADD)
    message.header.frame_id = BASE_FRAME
    message.pose.orientation.w = 1.0
    message.scale.x = width
    message.color = ColorRGBA(r=0.85, g=0.35, b=0.1, a=1.0)
    message.points = [_SAMPLE] * count
    return message


def decode_line_width(message: Marker) -> tuple[float, float]:
    """Return (t [s], width [m]) of a centreline.

    Raises:
        MessageError: The width is not positive and finite.
    """
    width = float(message.scale.x)
    if not 0.0 < width < np.inf:
        raise MessageError(f"width of a line strip must be positive and finite, got {width} m")
    return decode_stamp(message.header.stamp), width
