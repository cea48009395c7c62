"""What the tracker would say of a lay: markers and places with the errors that were measured."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from winding_core.lay.records import LAY_DTYPE, LayRecords
from winding_core.markers import MARKER_DTYPE, Markers
from winding_verification.closed_loop.truths import Truth

# A place is seen from here behind the contact line on, and a marker for this long [rad].
_SEEN_FROM = 0.15
_MARKER_SEEN = (0.05, 1.2)
_PLACE = math.radians(5.0)
_PLACES = 864


@dataclass(frozen=True, kw_only=True)
class CameraErrors:
    """Standard deviations of what the tracker measures (docs/vision.md).

    Attributes:
        frame_theta: Of a marker's angle in one frame [rad].
        frame_z: Of its height in one frame [m].
        marker_theta: What all frames of a marker have in common [rad].
        marker_z: The same of its height [m].
        lay_z: Of a place of the cable [m], anew for each place.
        common_z: What all places of a run have in common [m].
    """

    frame_theta: float = 3.0e-3
    frame_z: float = 1.2e-4
    marker_theta: float = 1.0e-3
    marker_z: float = 3.0e-5
    lay_z: float = 3.0e-5
    common_z: float = 3.0e-5


class SimulatedTracker:
    """Sees a lay with errors drawn at random, the same ones each time it looks at a place.

    Args:
        truth: The cable.
        errors: How wrong it is.
        rng: Of the errors.
    """

    def __init__(self, truth: Truth, errors: CameraErrors, rng: np.random.Generator) -> None:
        self._truth, self._errors, self._rng = truth, errors, rng
        self._common = errors.common_z * rng.standard_normal()
        self._of_markers: dict[int, tuple[float, float]] = {}
        self._of_places = errors.lay_z * rng.standard_normal(_PLACES)

    def markers(self, theta: float) -> Markers:
        """Return the records of one frame with the cylinder at a wound angle [rad]."""
        errors, rng = self._errors, self._rng
        near, far = _MARKER_SEEN
        at = self._truth.marker_theta()
        seen = [n for n in range(at.size) if near < theta - at[n] < far]
        records = np.zeros(len(seen), dtype=MARKER_DTYPE)
        for record, n in zip(records, seen, strict=True):
            if n not in self._of_markers:
                own = rng.standard_normal(2)
                self._of_markers[n] = (errors.marker_theta * own[0], errors.marker_z * own[1])
            angle, height = self._of_markers[n]
            frame = rng.standard_normal(2)
            record["id"] = n + 1
            record["theta"] = at[n] + angle + errors.frame_theta * frame[0]
            record["z"] = (
                float(self._truth.z_at(at[n])) + self._common + height + errors.frame_z * frame[1]
            )
            record["sigma_theta"], record["sigma_z"] = errors.frame_theta, errors.frame_z
        return records

    def lay(self, theta: float) -> LayRecords:
        """Return the places of the newest twelve turns with the cylinder at a wound angle [rad]."""
        last = int((theta - _SEEN_FROM) / _PLACE)
        numbers = np.arange(max(1, last - _PLACES + 1), last + 1)
        records = np.zeros(numbers.size, dtype=LAY_DTYPE)
        records["theta"] = numbers * _PLACE
        own = self._of_places[numbers % _PLACES]
        records["z"] = self._truth.z_at(records["theta"]) + self._common + own
        records["sigma_z"] = self._errors.lay_z
        seen: LayRecords = records[np.isfinite(records["z"])]
        return seen
