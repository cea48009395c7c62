"""Samples and measured values are passed on at a bearable pace."""

import heapq
from typing import NamedTuple

from winding_core.machine.joining import Sample


class Measured(NamedTuple):
    """One value [SI] of a quantity, by its name."""

    name: str
    value: float


# Readers keep two seconds of a topic; a burst of a quarter of that finds room.
_BURST_NS = 500_000_000
_SPEED = 4.0  # A quarter of a reader's two seconds is left to its stalls
# A look that comes late [s] makes no larger burst.
_LONGEST = 0.1
_NANO = 1e9


class Pacer:
    """Lets items go in the order of their timestamps, a long queue at four times their own pace."""

    def __init__(self, now: float) -> None:
        self._waiting: list[tuple[int, int, Sample | Measured]] = []
        self._count = 0
        self._newest_ns = 0
        self._last = now

    def add(self, stamp_ns: int, item: Sample | Measured) -> None:
        """Take a sample or a measured value with its timestamp [ns]."""
        heapq.heappush(self._waiting, (stamp_ns, self._count, item))
        self._count += 1
        self._newest_ns = max(self._newest_ns, stamp_ns)

    def take(self, now: float) -> list[tuple[int, Sample | Measured]]:
        """Return the items, with timestamps, whose turn it is at a monotonic time [s]."""
        elapsed, self._last = min(now - self._last, _LONGEST), now
        if not self._waiting:
            return []
        until = self._waiting[0][0] + round(_SPEED * elapsed * _NANO)
        if self._newest_ns - self._waiting[0][0] <= _BURST_NS:
            until = self._newest_ns
        items = []
        while self._waiting and self._waiting[0][0] <= until:
            stamp_ns, _, item = heapq.heappop(self._waiting)
            items.append((stamp_ns, item))
        return items
