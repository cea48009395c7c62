"""What became of one fault."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

CRASH_WITHIN = 0.3
HANG_WITHIN = 1.2
STAND_WITHIN = 0.5
# Not a crash and not a hang: three looks of the supervisor and the answer on its way.
NOTICE_WITHIN = 1.2
# Below this share of idle processor time, or with more than one process for each processor, a
# graph does not get its processor when it needs it.
_IDLE = 0.05
_LOAD = 1.0


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """One row of the table as it went."""

    fault: str  # What was done
    outcome: str  # What happened then
    survived: bool  # Whether that is what had to happen, judged by states alone
    injected_at: float = 0.0  # Simulated time of it [s]
    detected_by: str = ""  # Part that noticed; empty where nothing has to be noticed
    detected_after: float | None = None  # Wall time from the fault to its detection [s]
    detect_within: float = math.inf  # Its limit on a computer that is not saturated [s]
    stood_after: float | None = None  # Wall time from detection to standstill of both axes [s]
    load: float = 1.0  # Runnable processes for each processor meanwhile, 1 or more
    idle: float = 1.0  # Share of the processors' time that was idle meanwhile

    @property
    def saturated(self) -> bool:
        """Whether the computer was so busy that the graph's seconds were not its own."""
        return self.load > _LOAD or self.idle < _IDLE

    @property
    def in_time(self) -> bool:
        """Whether both times keep their limits."""
        return (self.detected_after or 0.0) <= self.detect_within and (
            self.stood_after or 0.0
        ) <= STAND_WITHIN

    @property
    def passed(self) -> bool:
        """Whether the fault was survived, and in time where the computer allows to judge that."""
        return self.survived and (self.saturated or self.in_time)

    @property
    def verdict(self) -> str:
        """The last column of the table."""
        if not self.survived:
            return "NO"
        if self.in_time:
            return "yes"
        return "yes (busy)" if self.saturated else "too late"

    def as_record(self) -> dict[str, object]:
        """Return the row for a JSON file."""
        record: dict[str, object] = asdict(self)
        if not math.isfinite(self.detect_within):
            record["detect_within"] = None
        return record | {"saturated": self.saturated, "passed": self.passed}
