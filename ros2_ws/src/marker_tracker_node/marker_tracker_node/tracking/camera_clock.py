"""What a run does about a camera whose clock is off: correct, warn, withhold, refuse."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.tracking.clock_offset import ClockEstimate, ClockOffset
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.encoder_history import EncoderHistory
from marker_tracker_node.tracking.run_means import SHIFT_SHARE
from winding_core.units import MILLISECOND

FloatArray = NDArray[np.float64]

# A length may be wrong by this share because of the clock; the part of it that may stay unknown.
LENGTH_SHARE = 0.002
WITHHELD_PART = 0.5
SIGMAS = 2.0
SURE = 3.0
# Of a marker's wound angle when it is found first [rad].
_FIRST_ERROR = 4.0e-3


@dataclass(frozen=True, kw_only=True)
class ClockSettings:
    """What to do about the camera's clock.

    Attributes:
        correct: Whether the measured offset is applied to the frames that follow.
        limit: Largest offset with which frames are used [s].
    """

    correct: bool = False
    limit: float = 0.25

    def __post_init__(self) -> None:
        if not 0.0 < self.limit <= 2.0:
            raise ValueError(f"camera_clock_limit must lie in 0 to 2 s, got {self.limit}")


class CameraClock:
    """The offset of a run's camera and what follows from it.

    A wound angle that rests on the encoder is wrong by offset x (speed - speed at which P0 was
    seen): nothing while the machine stands, most behind the ramp.

    Attributes:
        settings: What to do about it.
        withheld: Whether markers of the last frame were withheld.
        applied: Whether the offset is corrected by now.
    """

    def __init__(
        self, settings: ClockSettings, config: TrackerConfig, history: EncoderHistory
    ) -> None:
        """Start with nothing known.

        Args:
            settings: What to do about the offset.
            config: Of the tracker.
            history: The encoder's readings.
        """
        self.settings = settings
        self.withheld = False
        self._history = history
        self._offset = ClockOffset(history, config.marker_count + 1, settings.limit)
        self._tolerance = max(LENGTH_SHARE * config.expected_gap, _FIRST_ERROR)
        self._allowed = WITHHELD_PART * self._tolerance
        self._gap = config.expected_gap
        self._fastest = 0.0
        # Mean speed at which the tracker's shift was measured, and its weight in frames.
        self._usual = 0.0
        self._weight = 0.0
        self._strayed = 0.0
        self._missed = 0
        self.applied = False

    @property
    def estimate(self) -> ClockEstimate:
        """The offset so far."""
        return self._offset.estimate

    def lead(self, t: float, angle: float, shift: float) -> float:
        """Return how much further than reading and shift say P0 stands in a frame [rad].

        Args:
            t: Stamp of the frame [s].
            angle: Reading that the frame is paired with [rad].
            shift: See `Run` [rad].
        """
        # Every second frame without P0 asks the encoder alone, should the estimate be wrong.
        if not math.isfinite(self.estimate.shift) or self._missed % 2:
            return 0.0
        then = np.array([t - self.estimate.offset])
        return float(self._history.angles(then)[0]) + self.estimate.shift - angle - shift

    def take(self, t: float, azimuths: FloatArray) -> None:
        """Take what was seen in a frame that had a reading.

        Args:
            t: Its stamp [s].
            azimuths: Of the bands [rad], nan where not seen, shape (markers,).
        """
        self._offset.add(t, azimuths)
        speed = self._speed(t)
        sure = math.isfinite(self.estimate.error) and self._doubt(speed) <= self._allowed
        self.applied = self.applied or (self.settings.correct and sure)
        self._fastest = max(self._fastest, abs(speed))
        if math.isfinite(azimuths[0]):
            self._weight += 1.0
            self._usual += max(1.0 / self._weight, SHIFT_SHARE) * (speed - self._usual)
            self._missed = 0
        else:
            self._missed += 1

    def stray(self, lead: float) -> None:
        """Take note of a frame whose stamp lies far outside the encoder's readings.

        Args:
            lead: How far it is ahead of them, negative for behind [s].
        """
        self._strayed = lead

    def trusts(self, t: float) -> bool:
        """Return whether what is unknown of the offset leaves a frame's lengths alone."""
        usual = 0.0 if self.applied else self._usual
        return self._doubt(self._speed(t) - usual) <= self._allowed

    @property
    def refusal(self) -> str:
        """Why frames cannot be used; empty while they can."""
        limit = f"limit camera_clock_limit {self.settings.limit / MILLISECOND:.0f} ms"
        estimate = self.estimate
        if self._strayed:
            return f"{_ahead(self._strayed)}, {limit}: frames are refused"
        if abs(estimate.offset) - SURE * estimate.error > self.settings.limit:
            return f"{_ahead(estimate.offset)} or more, {limit}: frames are refused"
        return ""

    @property
    def warning(self) -> str:
        """What is wrong with lengths because of the clock; empty while nothing is."""
        estimate = self.estimate
        wrong = abs(estimate.offset) * self._fastest + self._doubt(self._fastest)
        significant = abs(estimate.offset) > SURE * estimate.error
        if wrong > self._tolerance and significant and not self.settings.correct:
            share = f"{100.0 * wrong / self._gap:.1f} %, limit {100.0 * LENGTH_SHARE:.1f} %"
            return (
                f"{_ahead(estimate.offset)}: lengths may be wrong by {share}; mend its stamps or "
                "set camera_clock_correction"
            )
        if self.withheld:
            return "the offset of the camera's clock is not known yet: markers are withheld"
        return ""

    def values(self) -> dict[str, str]:
        """Return the offset and its standard error [ms] as text; nan while nothing tells them."""
        estimate = self.estimate
        known = math.isfinite(estimate.error)
        numbers = (estimate.offset, estimate.error) if known else (math.nan, math.nan)
        offset, error = (f"{number / MILLISECOND:.2f}" for number in numbers)
        return {"camera_clock_offset_ms": offset, "camera_clock_offset_error_ms": error}

    def _doubt(self, speed: float) -> float:
        """Return by how much an angle may be wrong for what is not known of the offset [rad]."""
        return min(SIGMAS * self.estimate.error, self.settings.limit) * abs(speed)

    def _speed(self, t: float) -> float:
        return float(self._history.speeds(np.array([t - self.estimate.offset]))[0])


def _ahead(offset: float) -> str:
    way = "ahead of" if offset > 0.0 else "behind"
    return f"the camera's clock is {abs(offset) / MILLISECOND:.1f} ms {way} the encoder's"
