"""Measuring one band in its gate."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.camera.compiled import compiled
from marker_tracker_node.camera.pinhole import plane_of_pixel
from marker_tracker_node.detection.band import solve_band
from marker_tracker_node.detection.gate import gate_leaves_image, gate_moments
from marker_tracker_node.tracking.state import ALONG

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]

# What came of looking for a band.
OUT_OF_SIGHT, CLIPPED, HIDDEN, MEASURED = range(4)
# Share of the expected area within which a gathering of pixels may be a new band, and within
# which a known band is whole: one that is covered in part would be measured beside its middle.
NEW_AREA = (0.7, 1.4)
WHOLE_AREA = (0.87, 1.2)
TOUCH_REACH = 1.5


@compiled
def share_between(gates: FloatArray, first: int, second: int) -> bool:  # pragma: no cover
    """Keep two gates off each other's band along the cable and return whether the bands touch."""
    du = gates[second, 0] - gates[first, 0]
    dv = gates[second, 1] - gates[first, 1]
    along = abs(du * gates[first, 2] + dv * gates[first, 3])
    across = abs(gates[first, 2] * dv - gates[first, 3] * du)
    left, right = (first, second) if du > 0.0 else (second, first)
    reach = gates[left, 6] - gates[right, 5] + TOUCH_REACH
    longest = max(gates[first, 4], gates[first, 8]) + max(gates[second, 4], gates[second, 8])
    if across > reach or along > longest:
        return False
    if along < gates[first, 7] + gates[second, 7]:
        return True
    for mine, other in ((first, second), (second, first)):
        gates[mine, 4] = min(gates[mine, 4], along - gates[other, 7])
        gates[mine, 8] = min(gates[mine, 8], along - gates[other, 7])
    return False


@compiled
def in_picture(
    view: FloatArray, config: FloatArray, gate: FloatArray, rows: int, columns: int
) -> int:  # pragma: no cover
    """Return OUT_OF_SIGHT, CLIPPED or HIDDEN (nothing found yet) for a gate; see `GATE_SIZE`."""
    margin = config[ALONG] * view[12] / (abs(view[9]) * view[23]) - 1.0
    partly, wholly = gate_leaves_image(gate, margin, rows, columns)
    if wholly:
        return OUT_OF_SIGHT
    return CLIPPED if partly else HIDDEN


@compiled
def measure(
    frame: ByteArray,
    table: ByteArray,
    view: FloatArray,
    config: FloatArray,
    gate: FloatArray,
    expected: float,
    azimuth: float,
    z: float,
    slope: float,
    beside: FloatArray,
    limits: tuple[float, float],
) -> tuple[int, float, float, float]:  # pragma: no cover
    """Return what came of it, azimuth [rad], z [m] and measured over expected area.

    Args:
        frame: Shape (rows, columns, 3).
        table: See `gate_moments`.
        view: See `PinholeCamera.numbers`.
        config: See `TrackerConfig.numbers`.
        gate: Where to look, see `GATE_SIZE`.
        expected: Pixels that the band should fill times its usual share of them.
        azimuth: Expected [rad].
        z: Expected [m].
        slope: dz/dtheta [m/rad].
        beside: See `neighbours`.
        limits: Least and most accepted share of the expected area.
    """
    count, column, row = gate_moments(frame, table, gate)
    share = count / max(expected, 1.0)
    if count < 4 or share < limits[0] or share > limits[1]:
        return HIDDEN, math.nan, math.nan, share
    a, b = plane_of_pixel(view, column, row)
    found, height = solve_band(view, config, a, b, azimuth, z, slope, beside[0], beside[1])
    if not (math.isfinite(found) and math.isfinite(height)):
        return HIDDEN, math.nan, math.nan, share
    return MEASURED, found, height, share
