"""A run begins with the machine's first motion: what came long before is left out."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Generic, Protocol, TypeVar

from winding_core.readings import AxisReading

# Further from where it stood, an axis moves: above an encoder's noise, below a wound millimetre
# [rad, m].
MOTION = (2.0e-3, 1.0e-4)
# Slower than this an axis stands, as its encoder sees it [rad/s, m/s].
STANDING = (0.02, 6.0e-5)
# So much standstill belongs to the run [s].
LEAD_IN = 0.5


class Timed(Protocol):
    """Something that holds a reading and its time [s]."""

    @property
    def t(self) -> float:
        """Time of the reading [s]."""

    @property
    def reading(self) -> AxisReading:
        """Both axes."""


Item = TypeVar("Item", bound=Timed)


def has_moved(reading: AxisReading) -> bool:
    """Return whether an axis has left the origin, where the machine stood."""
    return abs(reading.cylinder_angle) > MOTION[0] or abs(reading.carriage_position) > MOTION[1]


def stands(reading: AxisReading) -> bool:
    """Return whether both axes are at rest, as far as their encoders can tell."""
    return abs(reading.angular_speed) < STANDING[0] and abs(reading.feed_speed) < STANDING[1]


class MotionStart(Generic[Item]):
    """Holds readings back until the machine moves; from then on everything passes.

    Args:
        awaited: Whether the motion is awaited; otherwise everything passes.
    """

    def __init__(self, *, awaited: bool) -> None:
        self._awaited = awaited
        self._held: deque[Item] = deque()

    def passed(self, item: Item) -> Iterator[Item]:
        """Yield what belongs to the run, the last of the standstill included."""
        if not self._awaited:
            yield item
            return
        self._held.append(item)
        while item.t - self._held[0].t > LEAD_IN:
            self._held.popleft()
        if has_moved(item.reading):
            self._awaited = False
            yield from self._held
            self._held.clear()
