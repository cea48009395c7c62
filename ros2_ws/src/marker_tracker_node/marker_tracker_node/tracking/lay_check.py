"""Whether the markers that were found, and those that were not, fit the lay that is expected."""

from __future__ import annotations

import math

import numpy as np

from marker_tracker_node.tracking.guide_readings import lay_share
from marker_tracker_node.tracking.laid_path import laid_cable, path_height
from marker_tracker_node.tracking.state import BY_READINGS, Setup
from marker_tracker_node.tracking.tracker_state import TrackerState

# A marker is late when the next one is due as well and it has come past the camera once more.
LATE_GAPS = 1.6
# Cable lies beside the expected path by this much in innocent runs [m].
USUALLY_BESIDE = 3.0e-3


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


def height_ratio(setup: Setup, state: TrackerState) -> float:
    """Return the heights of the markers over those of the path; nan if they lie on it.

    The path is that of the guide's readings as they are, without the offset that was fitted.
    """
    marks, run = state.tracks.marks, state.run
    cable = laid_cable(state.tracks, run)
    places = [n for n in range(1, marks.known.size) if marks.known[n]]
    if not places or not marks.known[0]:
        return math.nan
    offset = run.guide.offset if run.guide.belief == BY_READINGS else 0.0
    path = np.array(
        [
            path_height(cable, marks.theta[n])[0] - offset * lay_share(setup, marks.theta[n])
            for n in places
        ]
    )
    seen = marks.height[places] - marks.height[0]
    square = float(path @ path)
    if square == 0.0 or np.abs(seen - path).max() < USUALLY_BESIDE:
        return math.nan
    return float(path @ seen) / square
