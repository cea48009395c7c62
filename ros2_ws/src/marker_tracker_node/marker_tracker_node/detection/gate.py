"""Counting marker-coloured pixels: inside one band's gate, and along the laid cable."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.camera.compiled import compiled

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]

# A gate: centre column and row, unit direction along the cable, length along it, limits across
# it, half length of the band alone, length against the direction [px].
GATE_SIZE = 9


@compiled
def strip(
    slope: float, offset: float, low: float, high: float
) -> tuple[float, float]:  # pragma: no cover
    """Return between which x [pixels] a straight line slope x + offset stays within limits."""
    if abs(slope) < 1.0e-9:
        return (-math.inf, math.inf) if low <= offset <= high else (math.inf, -math.inf)
    first, second = (low - offset) / slope, (high - offset) / slope
    return min(first, second), max(first, second)


@compiled
def gate_moments(
    frame: ByteArray, table: ByteArray, gate: FloatArray
) -> tuple[int, float, float]:  # pragma: no cover
    """Return number and mean column and row of the marker pixels in a gate.

    Args:
        frame: Shape (rows, columns, 3).
        table: One where a colour belongs to the marker, by 5 bits of each channel.
        gate: See GATE_SIZE.
    """
    rows, columns = frame.shape[:2]
    column, row, tu, tv = gate[0], gate[1], gate[2], gate[3]
    ahead, behind, low, high = gate[4], gate[8], gate[5], gate[6]
    height = max(ahead, behind) * abs(tv) + max(-low, high) * abs(tu)
    top, bottom = max(math.ceil(row - height), 0), min(math.floor(row + height), rows - 1)
    count, sum_column, sum_row = 0, 0, 0
    for v in range(top, bottom + 1):
        dv = v - row
        # Across counts towards +z, to the right of a cable that runs up the image.
        left, right = strip(-tv, tu * dv, low, high)
        near, far = strip(tu, tv * dv, -behind, ahead)
        first = math.ceil(column + max(left, near, -column))
        last = math.floor(column + min(right, far, columns - 1.0 - column))
        line = frame[v]
        hits, place = 0, 0
        for u in range(first, last + 1):
            index = (
                (np.uint32(line[u, 0] >> 3) << 10)
                | (np.uint32(line[u, 1] >> 3) << 5)
                | np.uint32(line[u, 2] >> 3)
            )
            hit = table[index]
            hits += hit
            place += hit * u
        count += hits
        sum_column += place
        sum_row += hits * v
    if count == 0:
        return 0, math.nan, math.nan
    return count, sum_column / count, sum_row / count


@compiled
def gate_leaves_image(
    gate: FloatArray, margin: float, rows: int, columns: int
) -> tuple[bool, bool]:  # pragma: no cover
    """Return whether a gate without its margin [pixels] leaves the image, and whether wholly."""
    half = max(gate[4] - margin, gate[8] - margin, 0.0)
    span = max(max(-gate[5], gate[6]) - margin, 0.0)
    width = half * abs(gate[2]) + span * abs(gate[3])
    height = half * abs(gate[3]) + span * abs(gate[2])
    column, row = gate[0], gate[1]
    partly = (
        column - width < -0.5
        or column + width > columns - 0.5
        or row - height < -0.5
        or row + height > rows - 0.5
    )
    wholly = (
        column + width < -0.5
        or column - width > columns - 0.5
        or row + height < -0.5
        or row - height > rows - 0.5
    )
    return partly, wholly
