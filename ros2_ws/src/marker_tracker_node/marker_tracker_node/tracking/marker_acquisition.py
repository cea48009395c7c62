"""Looking for markers that are not known yet, along the cable that has been laid."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.camera.pinhole import pixel_of_plane, plane_of_point
from marker_tracker_node.detection.band import surface_point
from marker_tracker_node.detection.gate import ANY, in_gate, seeking, table_index
from marker_tracker_node.tracking.candidates import (
    APPROACH,
    P0_REACH,
    Scan,
    confirm_candidates,
    verify_candidate,
)
from marker_tracker_node.tracking.gate_prediction import OUT_OF_SIGHT, axis_scale
from marker_tracker_node.tracking.laid_path import LEAST_GAP, corrected_height, mean_gap
from winding_core.compiling import called

FloatArray = NDArray[np.float64]

MAX_NODES = 2048
# A search looks at one pixel in this length [m].
SEARCH_GRAIN = 0.24e-3
PEAKS = 3
LEAST_PEAK = 0.35


@called
def acquire_markers(scan: Scan, shift: float) -> float:  # pragma: no cover
    """Look where unknown markers may be; those that move with the cylinder become known.

    Args:
        scan: What is sought where.
        shift: See `Run` [rad].

    Returns:
        The shift, measured from P0 where that has become known [rad].
    """
    turn = 2.0 * math.pi
    usable = scan.setup.usable_azimuth
    starts, ends = _wanted_ranges(scan)
    for i in range(starts.size):
        # The visible part of every turn between the two wound angles.
        facing = scan.turned
        lap = 0
        while facing + usable >= starts[i]:
            low, high = max(starts[i], facing - usable), min(ends[i], facing + usable)
            if high > low:
                _scan_turn(scan, low, high)
            lap += 1
            facing = scan.turned - lap * turn
    return confirm_candidates(
        scan.setup, scan.cable.marks, scan.candidates, scan.picture.colour_of, shift
    )


@called
def _wanted_ranges(scan: Scan) -> tuple[FloatArray, FloatArray]:  # pragma: no cover
    """Return the wound angles [rad] between which unknown markers may lie, first and last."""
    marks = scan.cable.marks
    markers = marks.known.size
    starts, ends = np.empty(markers), np.empty(markers)
    if not marks.known[0]:
        starts[0], ends[0] = -P0_REACH, P0_REACH
        return starts[:1], ends[:1]
    count, last = 0, 0
    for n in range(1, markers):
        if marks.known[n]:
            if n - last > 1:
                gap = (marks.theta[n] - marks.theta[last]) / (n - last)
                starts[count] = marks.theta[last] + 0.4 * gap
                ends[count] = marks.theta[n] - 0.4 * gap
                count += 1
            last = n
    if last < markers - 1:
        starts[count] = marks.theta[last] + LEAST_GAP * mean_gap(scan.setup, marks, last)
        ends[count] = scan.turned + APPROACH
        count += 1
    return starts[:count], ends[:count]


@called
def _scan_turn(scan: Scan, first: float, last: float) -> None:  # pragma: no cover
    """Count marker pixels along one stretch of cable and verify where they gather."""
    setup, body = scan.setup, scan.setup.body
    scale = axis_scale(setup.camera)
    stride = max(int(scale * SEARCH_GRAIN), 1)
    step = stride / (scale * body.rho)
    nodes = min(int((last - first) / step) + 1, MAX_NODES)
    counts = np.zeros(nodes)
    offsets = np.zeros(nodes)
    for k in range(nodes):
        counts[k], offsets[k] = _count_across(scan, first + k * step, scale, stride)
    width = max(int(2.0 * body.half_band / (body.rho * step)), 1)
    least = LEAST_PEAK * 4.0 * body.half_band * body.cable_radius * scale * scale
    least /= stride * stride
    for _ in range(PEAKS):
        place, most = _densest_window(counts, width)
        if most < least:
            return
        end = min(place + width, nodes)
        theta = first + 0.5 * (place + end) * step
        shift = offsets[place:end].sum() / most / scale
        counts[place:end] = 0.0
        offsets[place:end] = 0.0
        verify_candidate(scan, theta, shift)


@called
def _count_across(
    scan: Scan, theta: float, scale: float, stride: int
) -> tuple[float, float]:  # pragma: no cover
    """Count marker pixels of no known marker in the row across the cable at a wound angle.

    Args:
        scan: What is sought where.
        theta: Wound angle [rad].
        scale: Of the image [px/m].
        stride: One in so many columns is looked at.

    Returns:
        Their number, and the sum of their distances from the cable's middle [px].
    """
    setup, body, pixels = scan.setup, scan.setup.body, scan.picture.pixels
    rows, columns = pixels.shape[:2]
    height, slope = corrected_height(scan.cable, theta)
    x, y, z = surface_point(body.rho, body.cable_radius, scan.turned - theta, height, slope, 0.0)
    a, b, _depth = plane_of_point(setup.camera, x, y, z)
    column, row = pixel_of_plane(setup.camera, a, b)
    v = int(round(row))  # noqa: RUF046
    count, offset = 0.0, 0.0
    table = seeking(scan.picture, ANY).table
    if not 0 <= v < rows:
        return count, offset
    reach = setup.search_width * scale
    left = max(math.ceil(column - reach), 0)
    right = min(math.floor(column + reach), columns - 1)
    for u in range(left, right + 1, stride):
        index = table_index(pixels[v, u, 0], pixels[v, u, 1], pixels[v, u, 2])
        if table[index] and not _claimed(scan, float(u), float(v)):
            count += 1.0
            offset += u - column
    return count, offset


@called
def _claimed(scan: Scan, u: float, v: float) -> bool:  # pragma: no cover
    """Return whether a pixel lies in the gate of a known marker."""
    for n in range(scan.outcome.size):
        if scan.outcome[n] != OUT_OF_SIGHT and in_gate(scan.gates, n, u, v):
            return True
    return False


@called
def _densest_window(counts: FloatArray, width: int) -> tuple[int, float]:  # pragma: no cover
    """Return where the stretch of a given width that holds most begins, and what it holds."""
    total, best, place = counts[:width].sum(), 0.0, 0
    for k in range(counts.size):
        if total > best:
            best, place = total, k
        total -= counts[k]
        if k + width < counts.size:
            total += counts[k + width]
    return place, best
