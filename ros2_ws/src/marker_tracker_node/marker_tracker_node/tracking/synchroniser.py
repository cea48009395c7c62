"""Pair every frame with the encoder reading of its own instant."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from winding_core.readings import AxisReading

# Four seconds of a 1 kHz encoder: without a camera nobody asks for what came before.
_MOST_READINGS = 4096


@dataclass(frozen=True, kw_only=True)
class PairedFrame:
    """A frame with the machine's position when it was exposed; None while the encoder was out.

    Attributes:
        t: Exposure [s].
        frame: Blue-green-red, shape (height, width, 3).
        cylinder_angle: [rad], unwrapped.
        guide_z: [m].
    """

    t: float
    frame: NDArray[np.uint8]
    cylinder_angle: float | None
    guide_z: float | None


class Synchroniser:
    """Holds frames until the encoder has caught up with them, in the order they came.

    Args:
        max_gap: Longest gap between readings that is interpolated [s].
        patience: How far frames may run ahead of the encoder before they go without it [s].
    """

    def __init__(self, max_gap: float = 0.02, patience: float = 0.1) -> None:
        self._max_gap = max_gap
        self._patience = patience
        self._readings: deque[tuple[float, float, float]] = deque(maxlen=_MOST_READINGS)
        self._frames: deque[tuple[float, NDArray[np.uint8]]] = deque()
        self._newest_frame = -np.inf

    def add_reading(self, t: float, reading: AxisReading) -> None:
        """Take an encoder sample; one that is not newer than the last is left out."""
        if not self._readings or t > self._readings[-1][0]:
            self._readings.append((t, reading.cylinder_angle, reading.carriage_position))

    def add_frame(self, t: float, frame: NDArray[np.uint8]) -> None:
        """Take a frame, shape (height, width, 3), of time t [s]."""
        self._frames.append((t, frame))
        self._newest_frame = max(self._newest_frame, t)

    def ready(self) -> Iterator[PairedFrame]:
        """Yield the frames whose encoder reading is known, or will not come in time."""
        while self._frames:
            t, frame = self._frames[0]
            covered = bool(self._readings) and self._readings[-1][0] >= t
            if not covered and self._newest_frame - t < self._patience:
                return
            self._frames.popleft()
            angle, guide = self._at(t) if covered else (None, None)
            yield PairedFrame(t=t, frame=frame, cylinder_angle=angle, guide_z=guide)

    def _at(self, t: float) -> tuple[float | None, float | None]:
        """Return (cylinder angle, guide z) at a time the readings reach; drop what is older."""
        while len(self._readings) > 1 and self._readings[1][0] <= t:
            self._readings.popleft()
        before = self._readings[0]
        after = self._readings[1] if len(self._readings) > 1 else before
        if before[0] > t or (t > before[0] and after[0] - before[0] > self._max_gap):
            return None, None
        share = 0.0 if after[0] == before[0] else (t - before[0]) / (after[0] - before[0])
        return (
            before[1] + share * (after[1] - before[1]),
            before[2] + share * (after[2] - before[2]),
        )
