"""What is judged of a run does not grow with it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from marker_tracker_node.tracking.checks.passings import passings_of
from marker_tracker_node.tracking.evidence import SightingLog
from marker_tracker_node.tracking.state import Burst

FRAME = np.zeros((32, 32, 3), dtype=np.uint8)
SPEED = 1.74


def watched(laps: int) -> SightingLog:
    """Return the log of a cylinder that turns evenly, one marker in sight over a radian."""
    log, out = SightingLog(), Burst.empty(1, 1)
    for t in np.arange(0.0, laps * 2.0 * math.pi / SPEED, 0.02).tolist():
        angle = SPEED * t
        away = math.remainder(angle, 2.0 * math.pi)
        out.angle[0] = angle
        out.rows["azimuth"][0, 0] = angle if abs(away) < 0.5 else math.nan
        log.add(FRAME, t, angle, out, 0)
    return log


@pytest.mark.parametrize("laps", [40, 900])
def test_the_first_and_the_newest_laps_are_judged(laps):
    log = watched(laps)
    found = passings_of(log)
    numbers = [item.lap for item in found]
    assert numbers[:2] == [0, 1]
    # The last one has begun, with half a radian before the end.
    assert numbers[-6:] == list(range(laps - 5, laps + 1))
    assert len(found) == 8
    # An even turn ahead each; a frame's share of a turn is no error of a straight line.
    turns = np.diff([item.ahead for item in found[-6:]])
    np.testing.assert_allclose(turns, 2.0 * math.pi, atol=1.0e-9 * laps)
    assert len(log.sightings) <= 16384
