"""When a message of a recording is due, with rate and pause; the clock is an argument."""

from __future__ import annotations


class Pacing:
    """Maps bag times to the wall clock.

    Args:
        rate: Bag seconds per wall second, positive.
        paused: Whether time stands still at first.
    """

    def __init__(self, rate: float, *, paused: bool = False) -> None:
        if not 0.0 < rate < float("inf"):
            raise ValueError(f"rate must be positive and finite, got {rate:g}")
        self._rate = rate
        self._paused = paused
        self._anchor: tuple[float, float] | None = None

    @property
    def paused(self) -> bool:
        """Whether time stands still."""
        return self._paused

    def start(self, bag_time: float, now: float) -> None:
        """Let bag time [s] be at `bag_time` when the clock says `now` [s]."""
        self._anchor = (bag_time, now)

    def bag_time(self, now: float) -> float:
        """Return the bag time [s] that has been reached.

        Raises:
            RuntimeError: Playback has not begun.
        """
        if self._anchor is None:
            raise RuntimeError("playback has not begun")
        bag_time, since = self._anchor
        return bag_time if self._paused else bag_time + self._rate * (now - since)

    def wait(self, bag_time: float, now: float) -> float | None:
        """Return how long [s] until a bag time is reached; None while paused."""
        if self._paused:
            return None
        return max(0.0, bag_time - self.bag_time(now)) / self._rate

    def set_paused(self, paused: bool, now: float) -> None:
        """Stop or go on; what passed on the wall clock in between does not count."""
        if self._anchor is not None:
            self._anchor = (self.bag_time(now), now)
        self._paused = paused
