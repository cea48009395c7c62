"""What became of one fault."""

from __future__ import annotations

import math
import os
from dataclasses import asdict, dataclass

CRASH_WITHIN = 0.3
HANG_WITHIN = 1.2
STAND_WITHIN = 0.5
# Not a crash and not a hang: three looks of the supervisor and the answer on its way.
NOTICE_WITHIN = 1.2


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """One row of the table as it went.

    Attributes:
        fault: What was done.
        injected_at: Simulated time of it [s].
        detected_by: Who noticed; empty where nothing has to be noticed.
        detected_after: Wall time from the fault to its detection [s].
        detect_within: Its bar on an idle machine [s].
        stood_after: Wall time from detection to standstill of both axes [s].
        outcome: What happened then.
        survived: Whether that is what had to happen.
        load: Processes that wanted each processor meanwhile, 1 or more; the bars stretch with it.
    """

    fault: str
    outcome: str
    survived: bool
    injected_at: float = 0.0
    detected_by: str = ""
    detected_after: float | None = None
    detect_within: float = math.inf
    stood_after: float | None = None
    load: float = 1.0

    @property
    def in_time(self) -> bool:
        """Whether both times keep their bars."""
        return (self.detected_after or 0.0) <= self.detect_within * self.load and (
            self.stood_after or 0.0
        ) <= STAND_WITHIN * self.load

    @property
    def passed(self) -> bool:
        """Whether the fault was survived, in time."""
        return self.survived and self.in_time

    def as_record(self) -> dict[str, object]:
        """Return the row for a JSON file."""
        record: dict[str, object] = asdict(self)
        if not math.isfinite(self.detect_within):
            record["detect_within"] = None
        return record | {"passed": self.passed}


def machine_load() -> float:
    """Return how many processes want each processor of this machine, 1 at least."""
    return max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))
