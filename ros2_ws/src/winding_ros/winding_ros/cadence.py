"""The rate of one topic, measured from its stamps, and the messages that break it."""

from __future__ import annotations

import statistics
from collections import deque

# The period is the median of so many steps and looked at again after so many messages.
STEPS = 64
LOOKED_AT_EVERY = 32
LEAST_STEPS = 8
# A gap longer than so many periods lost messages; one longer than this is an interruption [s].
LOST = 1.5
INTERRUPTION = 1.0
# A message that follows its predecessor so much later than their stamps say is late [s].
LATE = 0.05
# Share of lost messages that is said in a sentence, once so many have come.
TOLD_SHARE = 0.01
TOLD_AFTER = 200


class Cadence:
    """Counts what is lost, doubled, reordered and late, against the median period.

    Attributes:
        topic: Its name.
        period: Median step between stamps [s]; 0 before there are enough.
        counts: Messages by what is wrong with them; an interruption counts once.
    """

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self.period = 0.0
        self.counts = dict.fromkeys(("lost", "doubled", "reordered", "late", "interrupted"), 0)
        self._came = 0
        self._steps: deque[float] = deque(maxlen=STEPS)
        self._stamp: float | None = None
        self._arrival = 0.0

    def take(self, stamp: float, arrival: float) -> None:
        """Count a message of a stamp [s] that arrived at a wall time [s]."""
        before, came = self._stamp, self._arrival
        if before is not None and stamp < before:
            self.counts["reordered"] += 1
            return
        self._stamp, self._arrival = stamp, arrival
        self._came += 1
        if before is None:
            return
        step = stamp - before
        if step == 0.0:
            self.counts["doubled"] += 1
            return
        if arrival - came > step + LATE:
            self.counts["late"] += 1
        if step > INTERRUPTION and step > LOST * self.period > 0.0:
            self.counts["interrupted"] += 1
            return
        if self.period and step > LOST * self.period:
            self.counts["lost"] += round(step / self.period) - 1
        self._steps.append(step)
        if self._came % LOOKED_AT_EVERY == 0 or len(self._steps) == LEAST_STEPS:
            self.period = statistics.median(self._steps)

    def values(self) -> dict[str, str]:
        """Return rate [Hz] and counts as a status tells them; nothing before they are known."""
        if not self.period:
            return {}
        told = {f"{what} {self.topic}": str(count) for what, count in self.counts.items() if count}
        return {f"rate {self.topic}": f"{1.0 / self.period:.1f}", **told}

    @property
    def warning(self) -> str:
        """One sentence if many messages are lost; otherwise empty."""
        lost = self.counts["lost"]
        share = lost / (lost + self._came) if self._came >= TOLD_AFTER else 0.0
        if share < TOLD_SHARE:
            return ""
        return f"{self.topic} has lost {share:.0%} of its messages at {1.0 / self.period:.0f} Hz"
