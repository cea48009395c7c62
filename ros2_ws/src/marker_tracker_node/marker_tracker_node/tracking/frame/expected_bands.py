"""Where the known bands are expected in a frame, and what they share of it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from marker_tracker_node.arrays import FlagArray, FloatArray, IndexArray
from marker_tracker_node.detection.band import band_of
from marker_tracker_node.detection.gate import (
    COVERED,
    OUT_OF_SIGHT,
    Gates,
    Picture,
    gate_visibility,
)
from marker_tracker_node.tracking.frame.gate_prediction import (
    SHOWN_GAP,
    Shutter,
    bands_touch,
    gate_margin,
    gates_meet,
    guarded,
    predict_gate,
    separate_gates,
    turned_since,
)
from marker_tracker_node.tracking.frame.laid_path import (
    BAND_REACH,
    LaidCable,
    band_beside_turns,
    corrected_height,
    covered_at,
    covered_by_span,
    unknown_beside,
)
from marker_tracker_node.tracking.state import Candidates, Marks, Setup
from winding_core.compiling import called


class Expected(NamedTuple):
    """Where the known markers are expected in a frame, arrays of shape (markers,).

    Attributes:
        near: Whether its band is in sight, or so little beyond that it may touch one that is.
    """

    outcome: IndexArray  # What came of looking for the marker
    near: FlagArray
    touching: FlagArray  # Whether its band touches another
    pixels: FloatArray  # That its band should fill
    bands: FloatArray  # Fields of `Band`, shape (markers, 8)


@called
def empty_expected(count: int) -> Expected:  # pragma: no cover
    """Return room for what is expected of a number of markers."""
    flags = np.zeros((2, count), np.bool_)
    bands = np.zeros((count, 8))
    return Expected(np.zeros(count, np.int64), flags[0], flags[1], np.zeros(count), bands)


class Scan(NamedTuple):
    """A frame that is looked at."""

    picture: Picture  # Frame and colours
    setup: Setup  # Machine and camera
    shutter: Shutter  # Of the frame
    cable: LaidCable  # As laid so far
    candidates: Candidates  # What was found in earlier frames
    gates: Gates  # Of the markers; one more place is free for work
    expected: Expected  # Of the markers
    turned: float  # Cylinder angle as the camera sees it [rad]


@called
def expect_bands(scan: Scan, lead: float) -> None:  # pragma: no cover
    """Write where the known markers are expected, P0 further by a lead [rad], and their gates."""
    setup, marks, gates, expected = scan.setup, scan.cable.marks, scan.gates, scan.expected
    count = marks.known.size
    for n in range(count):
        azimuth = scan.turned - marks.recent[n] + (lead if n == 0 else 0.0)
        expected.outcome[n] = OUT_OF_SIGHT
        expected.near[n] = expected.touching[n] = False
        wound = marks.known[n] and (n == 0 or azimuth >= 0.0)
        if wound and abs(_away(azimuth)) <= setup.usable_azimuth + BAND_REACH:
            expect_band(scan, n, azimuth)
    for n in range(count):
        for m in range(n + 1, count):
            near = expected.near[n] and expected.near[m]
            if not (near and gates_meet(gates, n, m, SHOWN_GAP)):
                continue
            if bands_touch(gates, n, m):
                expected.touching[n] = expected.touching[m] = True
            ahead = marks.height[m] >= marks.height[n]
            _guard(scan, n, not ahead, ahead)
            _guard(scan, m, ahead, not ahead)
            separate_gates(gates, n, m)


@called
def expect_band(scan: Scan, n: int, azimuth: float) -> None:  # pragma: no cover
    """Write where a known marker is expected at an azimuth [rad], and its gate; see above."""
    setup, cable, expected, marks = scan.setup, scan.cable, scan.expected, scan.cable.marks
    theta, z = marks.recent[n], marks.height[n]
    beyond = abs(_away(azimuth)) > setup.usable_azimuth
    if beyond and not _beside(setup, marks, n):
        return
    slope = corrected_height(cable, theta)[1]
    azimuth += turned_since(setup, scan.shutter, azimuth, z)
    band = band_beside_turns(setup, cable, azimuth, theta, z, slope)
    band = guarded(setup, band, False, unknown_beside(setup, cable, theta))
    expected.near[n] = True
    expected.pixels[n] = predict_gate(setup, band, scan.gates, n)
    if not beyond:
        margin = gate_margin(setup)
        expected.outcome[n] = gate_visibility(scan.gates, n, margin, scan.picture)
        if covered_at(cable, theta) or covered_by_span(setup, cable, band, theta):
            expected.outcome[n] = COVERED
    expected.bands[n] = band


@called
def _away(azimuth: float) -> float:  # pragma: no cover
    """Return an azimuth [rad] without its whole turns."""
    return azimuth - math.tau * round(azimuth / (math.tau))


@called
def _beside(setup: Setup, marks: Marks, n: int) -> bool:  # pragma: no cover
    """Return whether another known marker lies so near along the cylinder that bands may meet."""
    reach = 2.0 * (setup.body.cable_radius + setup.across_margin)
    for m in range(marks.known.size):
        if m != n and marks.known[m] and abs(marks.height[m] - marks.height[n]) < reach:
            return True
    return False


@called
def _guard(scan: Scan, n: int, below: bool, above: bool) -> None:  # pragma: no cover
    """Cut the band n and its gate off before the turn below or above; see `guarded`."""
    setup, gates, expected = scan.setup, scan.gates, scan.expected
    before = band_of(expected.bands[n])
    band = guarded(setup, before, below, above)
    if band.low == before.low and band.high == before.high:
        return
    ahead, behind = gates.ahead[n], gates.behind[n]
    expected.pixels[n] = predict_gate(setup, band, gates, n)
    gates.ahead[n] = min(gates.ahead[n], ahead)
    gates.behind[n] = min(gates.behind[n], behind)
    expected.bands[n] = band
