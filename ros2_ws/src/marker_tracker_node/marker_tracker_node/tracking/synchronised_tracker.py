"""Frames and encoder readings as they come: paired by instant, and measured frame by frame."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from marker_tracker_node.arrays import ByteArray
from marker_tracker_node.tracking.camera_clock import CameraClock, ClockSettings
from marker_tracker_node.tracking.encoder_history import EncoderHistory
from marker_tracker_node.tracking.frame.laid_path import PROOF_HITS
from marker_tracker_node.tracking.report import FrameFault, TrackerReport
from marker_tracker_node.tracking.tracker import Tracker
from winding_core.machine.readings import AxisReading
from winding_core.markers import MarkerFlag, Markers

# What DDS has lost on the way it sends again after 0.1 s; simulated time waits after 0.25 s.
_PATIENCE = 0.2
_NUMBERS = ("x", "y", "z", "theta", "s", "sigma_theta", "sigma_z")


@dataclass(frozen=True, kw_only=True)
class PairedFrame:
    """A frame with the machine's position when it was exposed; None while the encoder was out.

    Attributes:
        astray: How far the stamp lies ahead of all encoder readings, negative for behind, when
            that is too far for any reading to come [s]; otherwise 0.
    """

    t: float  # Stamp [s]
    frame: ByteArray  # Blue-green-red, shape (height, width, 3)
    cylinder_angle: float | None  # [rad], unwrapped
    guide_z: float | None  # [m]
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
        patience: float = _PATIENCE,
        longest_lead: float = 0.5,
    ) -> None:
        """Start without frames.

        Frames may run ahead of a silent encoder by `patience` [s], and stamps may lie outside the
        readings of one that speaks by `longest_lead` [s].
        """
        self.history = EncoderHistory() if history is None else history
        self.correction = 0.0
        self._patience = patience
        self._longest_lead = longest_lead
        self._readings = 0
        # Time, picture, and how many readings had been heard when it came.
        self._frames: deque[tuple[float, ByteArray, int]] = deque()
        self._newest_frame = -math.inf
        # The newest frame when the encoder was last heard.
        self._heard = math.inf

    def add_reading(self, t: float, reading: AxisReading) -> None:
        """Take an encoder sample; one that is not newer than the last is left out."""
        self.history.add(t, reading.cylinder_angle, reading.carriage_position)
        self._readings += 1
        if self._frames:
            self._heard = self._newest_frame

    def add_frame(self, t: float, frame: ByteArray) -> None:
        """Take a frame, shape (height, width, 3), of time t [s]."""
        if not self._frames:
            self._heard = t
        self._frames.append((t, frame, self._readings))
        self._newest_frame = max(self._newest_frame, t)

    def ready(self, *, final: bool = False) -> Iterator[PairedFrame]:
        """Yield frames whose reading is known, or will not come in time; none comes if final."""
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
        if ahead > self._longest_lead and heard >= PROOF_HITS:
            return ahead
        return behind if behind < -self._longest_lead else 0.0


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

        Readings are added to the history; each frame is given to `beside` once it is measured.
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

    def add_frame(self, t: float, frame: ByteArray) -> None:
        """Take a frame, shape (height, width, 3), stamped t [s]."""
        self._pairs.add_frame(t, frame)

    def measured(self, *, final: bool = False) -> Iterator[tuple[float, Markers]]:
        """Yield stamp [s] and records of what can be measured now; no reading comes if final."""
        if self.tracker is None or self.clock is None:
            return
        for pair in self._pairs.ready(final=final):
            markers = self._measure(self.tracker, self.clock, pair)
            if self._beside is not None and len(markers):
                self._beside(pair, self.tracker)
            yield pair.t, markers

    def report(self) -> TrackerReport | None:
        """Return the tracker's report with what is wrong with the clock; None before `start`."""
        if self.tracker is None or self.clock is None:
            return None
        clock = "; ".join(filter(None, (self.clock.refusal, self.clock.warning)))
        return replace(self.tracker.report(), clock_doubt=clock)

    def _measure(self, tracker: Tracker, clock: CameraClock, pair: PairedFrame) -> Markers:
        clock.stray(pair.astray)
        if clock.refusal:
            return tracker.refuse(FrameFault.OTHER_CLOCK)
        angle = pair.cylinder_angle
        if angle is None:
            return tracker.track(pair.frame, pair.t, None, pair.guide_z)
        lead = clock.lead(pair.t, angle, tracker.phase)
        begun = tracker.beginnings
        markers = tracker.track(
            pair.frame, pair.t, angle, pair.guide_z, lead=lead, beside=clock.beside
        )
        if tracker.beginnings != begun:
            self.clock = CameraClock(self._settings, tracker.config, self.history)
            return markers
        if not len(markers):
            return markers
        clock.take(pair.t, tracker.seen)
        tracker.explain()
        if clock.applied:
            tracker.rebase(clock.estimate.shift + tracker.origin, forget=not self._pairs.correction)
            self._pairs.correction = clock.estimate.offset
        return _doubted(clock, markers)


def _doubted(clock: CameraClock, markers: Markers) -> Markers:
    """Return records with the clock's share of their deviations, without those it may spoil."""
    unknown = np.isinf(clock.doubt)
    markers["sigma_theta"] = np.hypot(markers["sigma_theta"], clock.doubt)
    clock.withheld = bool((unknown & ((markers["flags"] & MarkerFlag.NOT_WOUND) == 0)).any())
    for name in _NUMBERS:
        markers[name][unknown] = math.nan
    markers["flags"][unknown] = MarkerFlag.NOT_WOUND
    return markers
