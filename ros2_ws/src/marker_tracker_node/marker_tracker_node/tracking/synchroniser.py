"""Pair every frame with the encoder reading of its own instant."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.tracking.encoder_history import EncoderHistory
from winding_core.machine.readings import AxisReading

# An encoder that has spoken so often since a frame came is not silent.
_PROOF_READINGS = 3


@dataclass(frozen=True, kw_only=True)
class PairedFrame:
    """A frame with the machine's position when it was exposed; None while the encoder was out.

    Attributes:
        t: Stamp [s].
        frame: Blue-green-red, shape (height, width, 3).
        cylinder_angle: [rad], unwrapped.
        guide_z: [m].
        astray: How far the stamp lies ahead of all encoder readings, negative for behind, when
            that is too far for any reading to come [s]; otherwise 0.
    """

    t: float
    frame: NDArray[np.uint8]
    cylinder_angle: float | None
    guide_z: float | None
    astray: float = 0.0


class Synchroniser:
    """Holds frames until the encoder has caught up with them, in the order they came.

    Attributes:
        history: The encoder's readings.
        correction: How far the camera's clock is taken to be ahead of the encoder's [s].
    """

    def __init__(
        self,
        history: EncoderHistory | None = None,
        *,
        patience: float = 0.1,
        longest_lead: float = 0.5,
    ) -> None:
        """Start without frames.

        Args:
            history: To which readings are added.
            patience: How far frames may run ahead of a silent encoder before they go without
                it [s].
            longest_lead: How far stamps may lie outside the readings of one that speaks [s].
        """
        self.history = EncoderHistory() if history is None else history
        self.correction = 0.0
        self._patience = patience
        self._longest_lead = longest_lead
        self._readings = 0
        # Time, picture, and how many readings had been heard when it came.
        self._frames: deque[tuple[float, NDArray[np.uint8], int]] = deque()
        self._newest_frame = -math.inf
        # The newest frame when the encoder was last heard.
        self._heard = math.inf

    def add_reading(self, t: float, reading: AxisReading) -> None:
        """Take an encoder sample; one that is not newer than the last is left out."""
        self.history.add(t, reading.cylinder_angle, reading.carriage_position)
        self._readings += 1
        if self._frames:
            self._heard = self._newest_frame

    def add_frame(self, t: float, frame: NDArray[np.uint8]) -> None:
        """Take a frame, shape (height, width, 3), of time t [s]."""
        if not self._frames:
            self._heard = t
        self._frames.append((t, frame, self._readings))
        self._newest_frame = max(self._newest_frame, t)

    def ready(self, *, final: bool = False) -> Iterator[PairedFrame]:
        """Yield the frames whose encoder reading is known, or will not come in time.

        Args:
            final: Whether no reading comes any more.
        """
        while self._frames:
            t, frame, heard = self._frames[0]
            instant = t - self.correction
            covered = self.history.latest >= instant
            astray = self._astray(instant, self._readings - heard)
            silent = self._newest_frame - max(t, self._heard) >= self._patience
            if not (covered or astray or silent or final):
                return
            self._frames.popleft()
            if covered:
                self.history.look_up_to(instant)
            angle, guide = self.history.at(instant) if covered else (None, None)
            if guide is not None and math.isnan(guide):
                guide = None
            yield PairedFrame(t=t, frame=frame, cylinder_angle=angle, guide_z=guide, astray=astray)

    def _astray(self, instant: float, heard: int) -> float:
        if not len(self.history):
            return 0.0
        ahead = instant - self.history.latest
        behind = instant - self.history.first
        if ahead > self._longest_lead and heard >= _PROOF_READINGS:
            return ahead
        return behind if behind < -self._longest_lead else 0.0
