"""Where the tracker looks in a frame, so that others may look there and nowhere else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node import Tracker
from marker_tracker_node.detection.gate import OUT_OF_SIGHT, empty_gates
from marker_tracker_node.tracking.frame.expected_bands import Scan, empty_expected, expect_bands
from marker_tracker_node.tracking.frame.gate_prediction import shutter_of
from marker_tracker_node.tracking.frame.laid_path import laid_cable


@dataclass(frozen=True, kw_only=True)
class Box:
    """The upright rectangle around the gate of one marker in one frame.

    Attributes:
        marker: n of Pn.
        azimuth: At which the tracker expects the band, unwrapped [rad].
        left: First column.
        top: First row.
        right: One past the last column.
        bottom: One past the last row.
    """

    marker: int
    azimuth: float
    left: int
    top: int
    right: int
    bottom: int


def boxes_of(tracker: Tracker, frame: NDArray[np.uint8], angle: float) -> list[Box]:
    """Return where a tracker looks for the markers that it knows.

    Args:
        tracker: As it stands before the frame.
        frame: Shape (rows, columns, 3).
        angle: Of the encoder [rad].
    """
    setup, run, tracks = tracker._setup, tracker.state.run, tracker.state.tracks
    count = tracks.marks.known.size
    gates, expected = empty_gates(count + 1), empty_expected(count)
    picture = tracker._start.palette().picture(frame)
    cable = laid_cable(tracks, run)
    shutter = shutter_of(setup, run.cylinder.rate, frame.shape[0])
    turned = angle + run.shift
    scan = Scan(picture, setup, shutter, cable, tracks.candidates, gates, expected, turned)
    expect_bands(scan, 0.0)
    rows, columns = frame.shape[:2]
    boxes = []
    for n in np.flatnonzero(expected.outcome != OUT_OF_SIGHT):
        along = np.array([gates.along_u[n], gates.along_v[n]])
        across = np.array([-along[1], along[0]])
        corners = np.array([gates.column[n], gates.row[n]]) + [
            a * along + b * across
            for a in (-gates.behind[n], gates.ahead[n])
            for b in (gates.left[n], gates.right[n])
        ]
        (left, top), (right, bottom) = corners.min(axis=0), corners.max(axis=0)
        box = Box(
            marker=int(n),
            azimuth=float(expected.bands[n, 0]),
            left=max(int(np.ceil(left)), 0),
            top=max(int(np.ceil(top)), 0),
            right=min(int(right) + 1, columns),
            bottom=min(int(bottom) + 1, rows),
        )
        if box.left < box.right and box.top < box.bottom:
            boxes.append(box)
    return boxes
