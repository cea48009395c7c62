"""sensor_msgs/JointState: where the numbers of both axes stand in the messages of one driver."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from winding_ros.stamps import serialised_stamp
from winding_ros.wire.cdr import CdrReader

_DOUBLE = struct.Struct("<d")


@dataclass(frozen=True, kw_only=True, slots=True)
class JointStateLayout:
    """Where the numbers of two joints stand in the messages of one driver.

    Attributes:
        size: Of a message [bytes].
        fixed: What does not change: names and counts.
        positions: Offsets of both positions.
        velocities: Offsets of both velocities; None for joints without.
    """

    size: int
    fixed: tuple[tuple[slice, bytes], ...]
    positions: tuple[int, int]
    velocities: tuple[int | None, int | None]

    @classmethod
    def of(cls, data: bytes, joints: tuple[str, str]) -> JointStateLayout:
        """Return the layout of a message that has both joints and their positions.

        Raises:
            CdrError: The bytes are of another representation.
            ValueError: A joint or its position is missing.
        """
        reader = CdrReader(data)
        reader.skip(4, 2)
        reader.string()
        # Between the fields there may be anything.
        begin = reader.skip(4, 0)
        spans, names = [(begin, begin + 4)], []
        for _ in range(reader.u32()):
            begin = reader.skip(4, 0)
            names.append(reader.string())
            spans.append((begin, reader.offset))
        count = reader.skip(4, 0)
        first, positions = reader.doubles()
        spans.append((count, count + 4))
        count = reader.skip(4, 0)
        second, velocities = reader.doubles()
        spans.append((count, count + 4))
        places = tuple(names.index(joint) for joint in joints)
        if max(places) >= positions:
            raise ValueError(f"{positions} positions of {len(names)} joints")
        cylinder, carriage = places
        return cls(
            size=len(data),
            fixed=tuple((slice(begin, end), data[begin:end]) for begin, end in spans),
            positions=(first + 8 * cylinder, first + 8 * carriage),
            velocities=(
                second + 8 * cylinder if cylinder < velocities else None,
                second + 8 * carriage if carriage < velocities else None,
            ),
        )

    def fits(self, data: bytes) -> bool:
        """Return whether a message has this layout."""
        return len(data) == self.size and all(data[where] == what for where, what in self.fixed)

    def numbers(self, data: bytes) -> tuple[float, float, float, float, float]:
        """Return stamp [s], both positions and both velocities; nan for a velocity not measured."""
        at = _DOUBLE.unpack_from
        one, other = self.positions
        fast, slow = self.velocities
        return (
            serialised_stamp(data),
            at(data, one)[0],
            at(data, other)[0],
            float("nan") if fast is None else at(data, fast)[0],
            float("nan") if slow is None else at(data, slow)[0],
        )
