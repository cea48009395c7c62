"""Learning the marker colour in the run itself, from P0 where it must stand."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.detection.band import Band
from marker_tracker_node.detection.colour import (
    ColourModel,
    ColourRefusedError,
    colour_index,
    hue_region,
)
from marker_tracker_node.detection.gate import empty_gates
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.gate_prediction import axis_scale, predict_gate
from marker_tracker_node.tracking.state import Setup

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]

# How far P0 may appear from its place before the camera's pose was ever refined [m].
SEARCH_REACH = 5.0e-3
LEAST_AREA, MOST_AREA = 0.3, 1.7
SATURATIONS = np.arange(0.45, 0.95, 0.05)
NEAR_START = 0.3


@dataclass(frozen=True, kw_only=True)
class _Place:
    """Where P0 should appear.

    Attributes:
        column: Of its band's centroid [px].
        row: Of its band's centroid [px].
        reach: How far from there it may be [px].
        pixels: That its band should fill.
    """

    column: float
    row: float
    reach: float
    pixels: float

    @classmethod
    def predicted(cls, setup: Setup, angle: float) -> _Place:
        """Return the place of P0 at azimuth `angle`, z = 0."""
        gates = empty_gates(1)
        pixels = predict_gate(setup, Band(azimuth=angle, z=0.0, slope=0.0), gates, 0)
        (column,), (row,), (ahead,) = gates.column, gates.row, gates.ahead
        return cls(
            column=column,
            row=row,
            reach=ahead + SEARCH_REACH * axis_scale(setup.camera),
            pixels=pixels,
        )

    def window(self, frame: ByteArray, reach: float) -> tuple[slice, slice]:
        """Return the rows and columns of a frame within a distance [px]."""
        rows, columns = frame.shape[:2]
        top, bottom = int(self.row - reach), int(self.row + reach) + 1
        left, right = int(self.column - reach), int(self.column + reach) + 1
        return slice(max(top, 0), min(bottom, rows)), slice(max(left, 0), min(right, columns))


def sample_colour(
    frame: ByteArray, config: TrackerConfig, setup: Setup, angle: float
) -> ColourModel:
    """Learn the colour from P0, which stands at azimuth `angle` and z = 0.

    Args:
        frame: Shape (rows, columns, 3).
        config: Machine and cable.
        setup: Machine and camera for the kernels.
        angle: Cylinder angle [rad].

    Raises:
        ColourRefusedError: P0 is not there, or its pixels define no colour.
    """
    if abs(angle) > NEAR_START:
        raise ColourRefusedError(
            f"P0 can be sampled within {NEAR_START} rad of the start only, the cylinder is at "
            f"{angle:.2f} rad"
        )
    place = _Place.predicted(setup, angle)
    inner, expected = place.window(frame, place.reach), place.pixels
    patch = frame[inner]
    index = colour_index(patch)
    blob = np.zeros(patch.shape[:2], dtype=np.uint8)
    for saturation in SATURATIONS:
        prior = hue_region(config.marker_hue, config.marker_hue_tolerance, saturation)
        blob = _largest_blob(prior[index])
        # A cylinder of brass has the marker's hue and merges with it until only the marker is
        # saturated enough.
        if blob.sum() < MOST_AREA * expected:
            break
    if not LEAST_AREA * expected <= blob.sum() < MOST_AREA * expected:
        raise ColourRefusedError(
            f"P0 is not where it should be: {int(blob.sum())} pixels of its hue instead of "
            f"{expected:.0f}"
        )
    core = cv2.erode(blob, np.ones((3, 3), np.uint8), borderValue=0).astype(bool)
    if core.sum() < LEAST_AREA * expected:
        core = blob.astype(bool)
    _, wide = place.window(frame, 2.0 * place.reach)
    outside = np.ones(frame.shape[:2], dtype=bool)
    outside[inner] = cv2.dilate(blob, np.ones((7, 7), np.uint8)) == 0
    # Markers on the free span stand above P0 and are no background.
    outside[: inner[0].start, wide] = False
    return ColourModel.from_samples(patch[core], frame[outside])


def locate_marker(
    frame: ByteArray,
    colour: ColourModel,
    setup: Setup,
    angle: float,
    area: tuple[float, float],
) -> tuple[float, float]:
    """Return where P0's band appears near its place at azimuth `angle`, z = 0 [px].

    Args:
        frame: Shape (rows, columns, 3).
        colour: Of the markers.
        setup: Machine and camera for the kernels.
        angle: Azimuth of P0 [rad].
        area: Least and most accepted share of the pixels that its band should fill.

    Raises:
        ColourRefusedError: Nothing of its size is there.
    """
    place = _Place.predicted(setup, angle)
    inner, expected = place.window(frame, place.reach), place.pixels
    blob = _largest_blob(colour.mask(frame[inner]).astype(np.uint8))
    if not area[0] * expected <= blob.sum() <= area[1] * expected:
        raise ColourRefusedError(
            f"P0 is not where it should be: {int(blob.sum())} pixels of its colour instead of "
            f"{expected:.0f}"
        )
    rows, columns = np.nonzero(blob)
    return float(columns.mean() + inner[1].start), float(rows.mean() + inner[0].start)


def _largest_blob(mask: ByteArray) -> ByteArray:
    if mask.size == 0:
        return mask
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=4)
    if count < 2:
        return np.zeros_like(mask)
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    return np.asarray(labels == largest, dtype=np.uint8)
