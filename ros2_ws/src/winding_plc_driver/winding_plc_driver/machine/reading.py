"""Values and notifications as the server sent them: in SI, each once, in order, losses counted."""

import math
from dataclasses import dataclass

from winding_plc_driver.machine.mapping import Variable


@dataclass(frozen=True, kw_only=True)
class ServerValue:
    """One value of a notification."""

    title: str  # What the mapping calls the variable
    value: object  # As the server has it; None where it has none
    # Source timestamp, or the server's where there is none [ns since 1970]; None without either.
    stamp_ns: int | None
    bad: str = ""  # Name of the status when it is bad; empty otherwise
    # Whether the server dropped values before or after this one: its queue was full.
    overflow: bool = False


class VariableReader:
    """Reads the values of one variable.

    Attributes:
        taken: Values that became numbers.
        repeated: Values not newer than one before, which are dropped.
        unusable: Values that are no number or have a bad status or no timestamp.
        overflows: Times that the server's queue was full.
        complaint: What is wrong with the newest value; empty when nothing is.
        newest_ns: Newest timestamp [ns since 1970]; 0 before the first.
    """

    def __init__(self, name: str, variable: Variable) -> None:
        self.taken = self.repeated = self.unusable = self.overflows = self.newest_ns = 0
        self.complaint = ""
        self._name = name
        self._variable = variable
        self._raw: float | None = None
        self._turns = 0

    def read(self, value: ServerValue) -> tuple[int, float] | None:
        """Return (timestamp [ns], value in SI), or None for a value that is of no use."""
        self.overflows += value.overflow
        number, stamp_ns = value.value, value.stamp_ns
        self.complaint = ""
        if value.bad:
            self.complaint = f"{self._name} has the status {value.bad}"
        elif not isinstance(number, int | float) or not math.isfinite(number):
            self.complaint = f"{self._name} is no finite number but {number!r:.60}"
        elif stamp_ns is None:
            self.complaint = f"{self._name} comes without a timestamp"
        if self.complaint or stamp_ns is None or not isinstance(number, int | float):
            self.unusable += 1
            return None
        if stamp_ns <= self.newest_ns:
            # A new subscription begins with the value that the old one ended with.
            self.repeated += 1
            return None
        self.newest_ns = stamp_ns
        self.taken += 1
        return stamp_ns, self._unwrapped(float(number)) * self._variable.factor

    def _unwrapped(self, raw: float) -> float:
        """Return a value [unit of the server] that does not start again from 0."""
        span = self._variable.wraps_at
        if span and self._raw is not None:
            self._turns -= round((raw - self._raw) / span)
        self._raw = raw
        return raw + self._turns * span


_NUMBERS = 2**32 - 1  # Part 4 of OPC UA, 7.22: numbers begin with 1 and start again from 1


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
