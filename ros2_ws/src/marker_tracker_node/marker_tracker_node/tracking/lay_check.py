"""Whether the markers that were found, and those that were not, fit the lay that is expected."""

from __future__ import annotations

import math

import numpy as np

from marker_tracker_node.tracking.laid_path import LaidCable, path_height
from marker_tracker_node.tracking.state import Setup, TrackerState

# A marker is late when the next one is due as well and it has come past the camera once more.
LATE_GAPS = 1.6


def missing_markers(setup: Setup, state: TrackerState) -> tuple[int, ...]:
    """Return the numbers of the markers that should have been found long ago."""
    marks, run = state.tracks.marks, state.run
    known = np.flatnonzero(marks.known)
    if not known.size or known[0] != 0:
        return ()
    last = int(known[-1])
    gap = float(marks.theta[last]) / last if last else setup.expected_gap
    due = marks.theta[last] + LATE_GAPS * gap + 2.0 * math.pi
    late = [n for n in range(last) if not marks.known[n]]
    if last + 1 < marks.known.size and run.cylinder.angle > due:
        late.append(last + 1)
    return tuple(late)


def height_ratio(state: TrackerState) -> float:
    """Return the heights of the markers over those of the expected path; nan without any."""
    marks = state.tracks.marks
    cable = LaidCable(marks, state.tracks.path, state.run.path_filled)
    places = [n for n in range(1, marks.known.size) if marks.known[n]]
    if not places or not marks.known[0]:
        return math.nan
    path = np.array([path_height(cable, marks.theta[n])[0] for n in places])
    square = float(path @ path)
    return float(path @ (marks.height[places] - marks.height[0])) / square if square else math.nan
