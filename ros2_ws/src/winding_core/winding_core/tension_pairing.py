"""Give every encoder reading the load that hung on the cable at its instant."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from winding_core.readings import AxisReading

# Stamps are whole nanoseconds, carried as seconds.
_ROUNDING = 1.0e-6


@dataclass(frozen=True, kw_only=True)
class LoadedReading:
    """An encoder reading at t [s] with the newest tension [N] that is not younger; None for none.

    None also stands for a load cell that nobody listens to.
    """

    t: float
    reading: AxisReading
    tension: float | None


class TensionPairing:
    """Holds readings until the load cell has caught up with them.

    Two topics arrive in any order, and the model must not depend on it: its result is the same
    whichever came first. A load cell that is silent for longer than `patience` is not waited
    for until it is heard again; its last value holds.

    Args:
        period: Of the load cell [s].
        patience: How far readings may run ahead of a silent load cell [s].
        listened: Whether tension matters at all.
    """

    def __init__(self, period: float, *, patience: float = 0.2, listened: bool = True) -> None:
        self._period = period
        self._patience = patience
        self._listened = listened
        self._readings: deque[tuple[float, AxisReading]] = deque()
        self._tensions: deque[tuple[float, float]] = deque()
        self._heard_until: float | None = None
        self._silent = not listened

    def add_tension(self, t: float, force: float) -> None:
        """Take a load cell's value [N]."""
        if not self._listened or (self._tensions and t <= self._tensions[-1][0]):
            return
        self._tensions.append((t, force))
        self._heard_until = t
        self._silent = False

    def add_reading(self, t: float, reading: AxisReading) -> None:
        """Take an encoder sample."""
        self._readings.append((t, reading))

    def ready(self) -> Iterator[LoadedReading]:
        """Yield the readings whose tension is known, or will not come in time."""
        while self._readings:
            t, reading = self._readings[0]
            if not self._covered(t):
                return
            self._readings.popleft()
            yield LoadedReading(t=t, reading=reading, tension=self._at(t))

    def _covered(self, t: float) -> bool:
        known = self._heard_until
        if self._silent or (known is not None and known > t - self._period + _ROUNDING):
            return True
        waited = self._readings[-1][0] - (t if known is None else max(known, t - self._period))
        self._silent = waited >= self._patience
        return self._silent

    def _at(self, t: float) -> float | None:
        while len(self._tensions) > 1 and self._tensions[1][0] <= t + _ROUNDING:
            self._tensions.popleft()
        if not self._tensions or self._tensions[0][0] > t + _ROUNDING:
            return None
        return self._tensions[0][1]
