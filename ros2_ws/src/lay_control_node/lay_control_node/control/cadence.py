"""How far apart the commands of a motion are planned and leave, and whether that is too far."""

from dataclasses import dataclass

# A machine that waits half a second for a command has to hear of a gap before it stops [s].
LONGEST_GAP = 0.2
_ON_TIME = 2.0  # So long without such a gap, and the law commands again [s]


@dataclass(kw_only=True)
class Cadence:
    """Follows the commands of a motion, and the readings that they answer."""

    largest: float = 0.0  # Largest time between two commands that left [s]
    unplanned: float = 0.0  # Largest time between two that were planned from readings [s]
    largest_of_readings: float = 0.0  # Largest time between the arrivals of two readings [s]
    _sent: float | None = None
    _planned: float | None = None
    _read: float | None = None
    _late_until: float | None = None

    def read(self, arrived: float) -> None:
        """Take note of a reading that arrived at a time [s]."""
        if self._read is not None and self._sent is not None:
            self.largest_of_readings = max(self.largest_of_readings, arrived - self._read)
        self._read = arrived

    def since(self, now: float) -> float:
        """Return how long ago [s] the last command of this motion left; 0 without one."""
        return 0.0 if self._sent is None else now - self._sent

    def late(self, now: float) -> bool:
        """Return whether a command that is planned now [s], or one before it, is late."""
        gap = 0.0 if self._planned is None else now - self._planned
        self.unplanned = max(self.unplanned, gap)
        if gap > LONGEST_GAP:
            self._late_until = now + _ON_TIME
        return self._late_until is not None and now < self._late_until

    def plan(self, now: float) -> None:
        """Take note that a command is planned now [s]."""
        self._planned = now

    def send(self, now: float) -> None:
        """Take note that a command leaves now [s]."""
        self.largest = max(self.largest, self.since(now))
        self._sent = now

    def rest(self) -> None:
        """Take note that nothing is commanded: the next command begins a motion."""
        self._sent = self._planned = None
