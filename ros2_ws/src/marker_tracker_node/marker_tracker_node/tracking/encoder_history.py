"""The encoder's last readings: without wraps, interpolated, their period measured."""

from __future__ import annotations

import math

import numpy as np

from marker_tracker_node.arrays import FloatArray
from marker_tracker_node.tracking.machine_motion import lost_turns
from marker_tracker_node.tracking.state import KEPT

# Newest readings that tell the period, and newest sightings of a band that tell the clock.
ROWS = 128
# Over so long angles are interpolated: in a ramp of 1.74 rad/s^2 that errs by 0.1 mrad [s]. Gaps of
# so many periods are, where readings are lost in succession.
INTERPOLATED = 0.02
BRIDGED_PERIODS = 5.0
# Speeds are differences over this to either side [s]: of 8192 counts a turn one is 4 mrad/s.
HALF_SPAN = BRIDGED_PERIODS * INTERPOLATED


class EncoderHistory:
    """Positions over time, the last KEPT of them.

    Between two readings positions are interpolated linearly, which errs by at most
    acceleration x gap^2 / 8: 0.14 mrad at 40 Hz in a ramp of 1.74 rad/s^2, 0.54 mrad with one
    reading lost.

    Attributes:
        period: Median time between readings [s]; 0 before there are enough.
    """

    def __init__(self, longest_gap: float | None = None, *, complete: bool = False) -> None:
        """Start without readings.

        Gaps are interpolated up to the longest one [s], of a few measured periods if that is None.
        Readings are complete that come as far ahead of the frames as is looked, as a recording's
        do.
        """
        self._longest_gap = longest_gap
        self._complete = complete
        self._rows = np.empty((3, 2 * KEPT))
        self._count = self._seen = 0
        self._speed = 0.0
        self._added = 0
        self._wraps = 0.0
        self.period = 0.0

    def __len__(self) -> int:
        """Return how many readings are kept."""
        return self._count

    def add(self, t: float, angle: float, guide: float) -> None:
        """Take angle [rad] and guide position [m] of time t [s]; whole turns may be missing.

        A reading that is not newer than the last is left out.
        """
        if self._count and not t > self.latest:
            return
        if self._count == self._rows.shape[1]:
            self._rows[:, :KEPT] = self._rows[:, KEPT:].copy()
            self._count = KEPT
        if self._count:
            passed = t - self.latest
            before = self._rows[1, self._count - 1]
            self._wraps += lost_turns(angle + self._wraps - before, self._speed * passed)
            self._speed = (angle + self._wraps - before) / passed
        rows = self._rows
        rows[0, self._count], rows[1, self._count] = t, angle + self._wraps
        rows[2, self._count] = guide
        self._count += 1
        self._seen = self._count
        self._added += 1
        if self._added in (4, 16) or self._added % ROWS == 0:
            self.period = float(np.median(np.diff(self._times[-ROWS:])))

    def look_up_to(self, t: float) -> None:
        """Leave out what came after the first reading at t or later [s], until the next one comes.

        What a frame is measured with must not depend on how far the encoder is ahead of it.
        """
        if self._complete:
            return
        self._seen = min(int(np.searchsorted(self._rows[0, : self._count], t)) + 1, self._count)

    @property
    def lost_turns(self) -> int:
        """Turns that the encoder lost by wrapping."""
        return round(self._wraps / (math.tau))

    @property
    def latest(self) -> float:
        """Time of the last reading [s]."""
        return float(self._rows[0, self._count - 1]) if self._count else -math.inf

    @property
    def newest(self) -> float:
        """Time of the last reading that is looked at [s]."""
        return float(self._rows[0, self._seen - 1]) if self._seen else -math.inf

    @property
    def first(self) -> float:
        """Time of the first reading that is kept [s]."""
        return float(self._rows[0, 0]) if self._count else math.inf

    @property
    def _times(self) -> FloatArray:
        return self._rows[0, : self._seen]

    def at(self, t: float) -> tuple[float | None, float | None]:
        """Return (cylinder angle [rad], guide [m]); None where readings are missing."""
        after = int(np.searchsorted(self._times, t))
        if after == self._seen or (after == 0 and self._times[0] > t):
            return None, None
        if self._times[after] == t:
            return float(self._rows[1, after]), float(self._rows[2, after])
        (start, *first), (end, *second) = self._rows[:, after - 1], self._rows[:, after]
        longest = self._longest_gap
        if longest is None:
            longest = max(INTERPOLATED, BRIDGED_PERIODS * self.period)
        if end - start > longest:
            return None, None
        share = (t - start) / (end - start)
        angle, guide = (a + share * (b - a) for a, b in zip(first, second, strict=True))
        return float(angle), float(guide)

    def angles(self, times: FloatArray) -> FloatArray:
        """Return the cylinder angles [rad] at times [s], standing outside the readings."""
        return np.interp(times, self._times, self._rows[1, : self._seen])

    def speed(self, t: float) -> float:
        """Return the cylinder speed [rad/s] at a time [s], the last one after the readings."""
        middle = min(max(t, self.first), self.newest)
        span = np.clip([middle - HALF_SPAN, middle + HALF_SPAN], self.first, self.newest)
        before, after = self.angles(span)
        return float((after - before) / max(span[1] - span[0], INTERPOLATED))
