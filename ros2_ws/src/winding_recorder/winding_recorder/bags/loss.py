"""Count publications that never arrived."""

from __future__ import annotations


class LossCount:
    """Follows one publisher's sequence numbers, which DDS counts from 1.

    A number that is not above the last one is a new publisher's; what it sent before is not
    known to be lost. What is lost after the last message that arrived cannot be seen.
    """

    def __init__(self) -> None:
        self.received = 0
        self.lost = 0
        self._last: int | None = None

    def take(self, sequence: int) -> None:
        """Count a message that arrived, and those that should have arrived before it."""
        self.received += 1
        if self._last is not None and sequence > self._last:
            self.lost += sequence - self._last - 1
        self._last = sequence
