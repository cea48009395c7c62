"""Frames and encoder readings as they come, each with its own clock; markers of every frame."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.tracking.camera_clock import CameraClock, ClockSettings
from marker_tracker_node.tracking.encoder_history import EncoderHistory
from marker_tracker_node.tracking.report import FrameFault
from marker_tracker_node.tracking.synchroniser import PairedFrame, Synchroniser
from marker_tracker_node.tracking.tracker import Tracker
from winding_core.machine.readings import AxisReading
from winding_core.markers import MarkerFlag, Markers

_NUMBERS = ("x", "y", "z", "theta", "s", "sigma_theta", "sigma_z")


class SynchronisedTracker:
    """A tracker whose frames meet the encoder reading of their own instant.

    Attributes:
        tracker: Of this run; None before `start`.
        clock: Of the camera; None before `start`.
        history: The encoder's readings.
    """

    def __init__(
        self,
        settings: ClockSettings,
        history: EncoderHistory | None = None,
        *,
        beside: Callable[[PairedFrame, Tracker], None] | None = None,
    ) -> None:
        """Take readings and frames from now on; frames wait until `start`.

        Args:
            settings: What to do about the camera's clock.
            history: To which readings are added.
            beside: Takes each frame after the tracker has measured it.
        """
        self.tracker: Tracker | None = None
        self.clock: CameraClock | None = None
        self._settings = settings
        self._beside = beside
        self._pairs = Synchroniser(history, longest_lead=2.0 * settings.limit)
        self.history = self._pairs.history

    def start(self, tracker: Tracker) -> None:
        """Measure with a tracker that has seen nothing yet."""
        self.tracker = tracker
        self.clock = CameraClock(self._settings, tracker.config, self.history)

    def add_reading(self, t: float, reading: AxisReading) -> None:
        """Take an encoder sample of time t [s]."""
        self._pairs.add_reading(t, reading)

    def add_frame(self, t: float, frame: NDArray[np.uint8]) -> None:
        """Take a frame, shape (height, width, 3), stamped t [s]."""
        self._pairs.add_frame(t, frame)

    def measured(self, *, final: bool = False) -> Iterator[tuple[float, Markers]]:
        """Yield stamp [s] and records of the frames that can be measured now.

        Args:
            final: Whether no reading comes any more.
        """
        if self.tracker is None or self.clock is None:
            return
        for pair in self._pairs.ready(final=final):
            markers = self._measure(self.tracker, self.clock, pair)
            if self._beside is not None and len(markers):
                self._beside(pair, self.tracker)
            yield pair.t, markers

    def _measure(self, tracker: Tracker, clock: CameraClock, pair: PairedFrame) -> Markers:
        clock.stray(pair.astray)
        if clock.refusal:
            return tracker.refuse(FrameFault.OTHER_CLOCK)
        angle = pair.cylinder_angle
        if angle is None:
            return tracker.track(pair.frame, pair.t, None, pair.guide_z)
        lead = clock.lead(pair.t, angle, tracker.state.run.shift - tracker.origin)
        begun = tracker.beginnings
        markers = tracker.track(pair.frame, pair.t, angle, pair.guide_z, lead=lead)
        if tracker.beginnings != begun:
            self.clock = clock = CameraClock(self._settings, tracker.config, self.history)
        if not len(markers):
            return markers
        clock.take(pair.t, tracker.seen)
        if clock.applied:
            tracker.rebase(clock.estimate.shift + tracker.origin, forget=not self._pairs.correction)
            self._pairs.correction = clock.estimate.offset
        return _withheld(clock, pair.t, markers)


def _withheld(clock: CameraClock, t: float, markers: Markers) -> Markers:
    """Return records in which only P0 is told while the clock is in doubt."""
    clock.withheld = False
    if clock.trusts(t):
        return markers
    later = markers[1:]
    clock.withheld = bool(((later["flags"] & MarkerFlag.NOT_WOUND) == 0).any())
    for name in _NUMBERS:
        later[name] = math.nan
    later["flags"] = MarkerFlag.NOT_WOUND
    return markers
