"""Notifications of a subscription are numbered: what is missing and what comes twice shows."""

from __future__ import annotations

# Part 4 of OPC UA, 7.22: numbers begin with 1 and start again from 1.
_NUMBERS = 2**32 - 1


class SequenceNumbers:
    """Follows the sequence numbers of one subscription.

    Attributes:
        gaps: Notifications that were sent and can no longer be had.
        repeated: Notifications that came again, and were dropped.
        fetched: Notifications that were missed and had from the server afterwards.
    """

    def __init__(self) -> None:
        self.gaps = self.repeated = self.fetched = 0
        self._next = 1

    def restart(self) -> None:
        """Begin with a new subscription."""
        self._next = 1

    def missing(self, number: int) -> list[int]:
        """Return the numbers before one that have not come, oldest first."""
        count = (number - self._next) % _NUMBERS
        if count > _NUMBERS // 2:
            return []
        return [(self._next + k - 1) % _NUMBERS + 1 for k in range(count)]

    def skip(self, number: int) -> None:
        """Note that a notification can no longer be had."""
        self.gaps += 1
        self._next = number % _NUMBERS + 1

    def take(self, number: int) -> bool:
        """Note a notification with content; return whether it is new."""
        if (number - self._next) % _NUMBERS > _NUMBERS // 2:
            self.repeated += 1
            return False
        self._next = number % _NUMBERS + 1
        return True
