"""The cable's centreline as a line strip, for viewers."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import Point
from numpy.typing import NDArray
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from winding_ros.message_error import MessageError
from winding_ros.rig_messages import BASE_FRAME
from winding_ros.stamps import decode_stamp
from winding_ros.wire.cdr import COUNT, serialised
from winding_ros.wire.template import Template, number_at

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
