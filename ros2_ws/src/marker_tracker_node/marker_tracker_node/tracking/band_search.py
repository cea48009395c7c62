"""P0 where nobody said that it stands: bands of its hue on its place along the axis."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.camera.pinhole import plane_of_pixel
from marker_tracker_node.detection.band import Band, solve_band
from marker_tracker_node.detection.colour import colour_index, hue_region
from marker_tracker_node.detection.gate import empty_gates
from marker_tracker_node.tracking.colour_sampling import MOST_AREA, SATURATIONS, SEARCH_REACH
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.gate_prediction import axis_scale, predict_gate
from marker_tracker_node.tracking.state import Setup
from winding_core.helix import FleetAngleLaw

ByteArray = NDArray[np.uint8]

# A band is whole enough to be told by its colour.
LEAST_AREA = 0.5
# It stays at its place of the cylinder within this, as poorly as the camera's pose is known.
SAME_ANGLE, SAME_HEIGHT = 0.08, 1.5e-3
# It proves itself by moving with the cylinder as long as markers do.
PROOF_SIGHTINGS, PROOF_ADVANCE = 4, 0.1
TURN = 2.0 * math.pi


@dataclass(kw_only=True)
class Passing:
    """Something of the marker's hue that may move with the cylinder.

    Attributes:
        offset: Its azimuth less the encoder's angle [rad], within half a turn of zero.
        z: As seen [m].
        first: Encoder angle when it was seen first [rad].
        last: The same when it was seen last [rad].
        sightings: How often it was seen.
        samples: Pixels of it, blue-green-red.
    """

    offset: float
    z: float
    first: float
    last: float
    sightings: int = 1
    samples: list[ByteArray] = field(default_factory=list)

    @property
    def proven(self) -> bool:
        """Whether it moves with the cylinder."""
        moved = abs(self.last - self.first)
        return self.sightings >= PROOF_SIGHTINGS and moved >= PROOF_ADVANCE


class BandSearch:
    """Follows what has the hue of a marker and lies where P0 passes, until it is P0."""

    def __init__(self, config: TrackerConfig) -> None:
        """Start with nothing seen."""
        self._config = config
        self._passing: list[Passing] = []
        self._begun = math.nan
        law = FleetAngleLaw(
            advance_per_radian=config.advance_per_radian,
            free_length=config.free_length,
            radius=config.centreline_radius,
        )
        # Nearer to P0's place than to that of P1 on its first turn.
        self._surely = 0.5 * float(law.z(config.expected_gap))

    def add(self, frame: ByteArray, setup: Setup, angle: float) -> Passing | None:
        """Take a frame and return P0, once it is known which of the bands it is.

        Args:
            frame: Shape (rows, columns, 3).
            setup: Machine and camera.
            angle: What the encoder says [rad].
        """
        if math.isnan(self._begun):
            self._begun = angle
        for azimuth, z, samples in bands_of_hue(frame, self._config, setup):
            self._take(angle, azimuth, z, samples)
        proven = [band for band in self._passing if band.proven]
        if not proven:
            return None
        lowest = min(proven, key=lambda band: band.z)
        if abs(lowest.z) < self._surely or abs(angle - self._begun) > TURN:
            return lowest
        return None

    @property
    def moving(self) -> bool:
        """Whether something of the marker's hue has moved with the cylinder so far."""
        return any(
            band.sightings > 1 and abs(band.last - band.first) > SAME_ANGLE
            for band in self._passing
        )

    def _take(self, angle: float, azimuth: float, z: float, samples: ByteArray) -> None:
        offset = math.remainder(azimuth - angle, TURN)
        for band in self._passing:
            off = math.remainder(offset - band.offset, TURN)
            if abs(off) < SAME_ANGLE and abs(z - band.z) < SAME_HEIGHT:
                band.sightings += 1
                share = 1.0 / band.sightings
                band.offset = math.remainder(band.offset + share * off, TURN)
                band.z += share * (z - band.z)
                band.last = angle
                band.samples = [*band.samples[-3:], samples]
                return
        recent = sorted(self._passing, key=lambda band: band.sightings)[-15:]
        self._passing = [
            *recent, Passing(offset=offset, z=z, first=angle, last=angle, samples=[samples])
        ]  # fmt: skip


def bands_of_hue(
    frame: ByteArray, config: TrackerConfig, setup: Setup
) -> list[tuple[float, float, ByteArray]]:
    """Return azimuth [rad], z [m] and pixels of what looks like P0 anywhere in its pass.

    Bands of later turns may touch that of P0 on the +z side: the first cable's width counts.
    """
    gates = empty_gates(1)
    area = predict_gate(setup, Band(azimuth=0.0, z=0.0, slope=0.0), gates, 0)
    scale = axis_scale(setup.camera)
    wide = 2.0 * config.cable_radius * scale
    reach = 0.5 * wide + SEARCH_REACH * scale
    left = max(int(gates.column[0] - reach), 0)
    right = int(gates.column[0] + reach) + 1
    strip = frame[:, left:right]
    if not strip.size:
        return []
    index = colour_index(strip)
    for saturation in SATURATIONS:
        mask = hue_region(config.marker_hue, config.marker_hue_tolerance, saturation)[index]
        found = _bands(mask, strip, left, wide, area, setup)
        if found:
            return found
    return []


def _bands(
    mask: ByteArray, strip: ByteArray, left: int, wide: float, area: float, setup: Setup
) -> list[tuple[float, float, ByteArray]]:
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=4)
    found = []
    for label in range(1, count):
        first = int(stats[label, cv2.CC_STAT_LEFT])
        part = labels == label
        if stats[label, cv2.CC_STAT_WIDTH] > 1.4 * wide:
            part[:, first + round(wide) :] = False
        size = int(part.sum())
        # Seen from the side a band is shorter.
        if not 0.5 * LEAST_AREA * area <= size <= MOST_AREA * area:
            continue
        rows, columns = np.nonzero(part)
        if rows.min() == 0 or rows.max() == mask.shape[0] - 1:
            continue
        a, b = plane_of_pixel(setup.camera, float(columns.mean()) + left, float(rows.mean()))
        # What stands before the contact line may be cable that is not wound yet.
        start = Band(azimuth=0.5, z=0.0, slope=0.0)
        azimuth, z = solve_band(setup.camera, setup.body, a, b, start)
        if not (-0.2 <= azimuth <= setup.usable_azimuth) or abs(z) > SEARCH_REACH:
            continue
        expected = predict_gate(setup, Band(azimuth=azimuth, z=z, slope=0.0), empty_gates(1), 0)
        if LEAST_AREA * expected <= size <= MOST_AREA * expected:
            found.append((azimuth, z, strip[part]))
    return found
