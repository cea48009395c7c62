"""Whether the guide's readings are believed, or the cable is expected by the commanded feed.

A guide may dwell and go back, so its readings are believed until the markers lie elsewhere. What no
guide can do is not believed at all.
"""

from __future__ import annotations

import math

from marker_tracker_node.arrays import FloatArray
from marker_tracker_node.tracking.frame.acquisition import PROOF_ADVANCE
from marker_tracker_node.tracking.frame.laid_path import (
    LAY_SIGMA,
    LEAST_GAP,
    beside_path,
    known_around,
    mean_gap,
)
from marker_tracker_node.tracking.state import (
    BY_READINGS,
    CONTRADICTED,
    IMPOSSIBLE,
    TRIED,
    Guide,
    Marks,
    Run,
    Setup,
)
from winding_core.compiling import called

# A guide that moves so many times as far as the feed, or as one turn beside the other, while a
# marker proves itself does not exist: its readings are millimetres.
MOST_SCALE = 50.0
# A number may be set, or a guide move, so many times too far or too little: what is beyond has
# another cause.
USUAL_SCALE = 1.4


@called
def judge_guide(
    setup: Setup, run: Run, marks: Marks, paths: FloatArray
) -> None:  # pragma: no cover
    """Decide at a frame what the run believes of the guide's readings; paths as in `Tracks`."""
    guide, filled, angle = run.guide, run.path_filled, run.cylinder.angle
    turned = abs(guide.turned)
    if guide.belief >= CONTRADICTED or turned < PROOF_ADVANCE:
        return
    feed = setup.advance_per_radian
    most = max(abs(feed), setup.body.cable_radius / math.pi) * turned * MOST_SCALE
    if abs(guide.travel) > most:
        _believe(guide, IMPOSSIBLE, angle)
        return
    expected = feed * guide.turned
    # In a turn or more; beyond that the markers decide.
    usual = abs(expected) <= USUAL_SCALE * abs(guide.travel)
    usual = usual and abs(guide.travel) <= USUAL_SCALE * abs(expected)
    usual = usual and guide.travel * expected >= 0.0
    if turned < math.tau or usual or not marks.known[0]:
        return
    last = known_around(marks, math.inf)[0]
    if last > 0:
        by_readings = abs(beside_path(setup, guide, marks, paths, filled, 0, last))
        by_feed = abs(beside_path(setup, guide, marks, paths, filled, 1, last))
        if by_readings > by_feed + LAY_SIGMA:
            _believe(guide, CONTRADICTED, angle)
            return
        if by_feed > by_readings + LAY_SIGMA and guide.belief == TRIED:
            _believe(guide, BY_READINGS, angle)
            return
    due = overdue(setup, marks, last) + setup.usable_azimuth
    missing = last < marks.known.size - 1 and angle > due
    if missing and angle > guide.since + math.tau:
        _believe(guide, BY_READINGS if guide.belief == TRIED else TRIED, angle)


@called
def _believe(guide: Guide, belief: int, angle: float) -> None:  # pragma: no cover
    """Take another belief in a guide's readings, decided at a cylinder angle [rad]."""
    guide.belief = belief
    guide.since = angle


@called
def overdue(setup: Setup, marks: Marks, last: int) -> float:  # pragma: no cover
    """Return the wound angle [rad] where a marker would be the one after that behind the last."""
    return float(marks.theta[last] + (1.0 + LEAST_GAP) * mean_gap(setup, marks, last))
