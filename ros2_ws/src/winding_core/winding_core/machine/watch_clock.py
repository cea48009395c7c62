"""Time as a watch counts it that may be held itself."""

_LONGEST_LOOK = 0.2  # Between two looks no more time counts than this [s]


class WatchClock:
    """Counts time that was looked at: what a held process missed is no silence of the machine."""

    def __init__(self) -> None:
        self.time = 0.0  # So far [s]
        self._last: float | None = None

    def look(self, now: float) -> float:
        """Return the time looked at so far, at monotonic wall time now [s]."""
        if self._last is not None:
            self.time += min(max(now - self._last, 0.0), _LONGEST_LOOK)
        self._last = now
        return self.time
