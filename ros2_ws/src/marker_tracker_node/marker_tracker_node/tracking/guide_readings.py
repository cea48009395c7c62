"""What of the guide's readings can be believed: their zero is unknown, their scale may be wrong.

A guide may dwell and go back, so what it does is believed until the markers lie elsewhere. What no
guide can do is not believed at all.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.tracking.laid_path import LaidCable, mean_gap, path_height
from marker_tracker_node.tracking.state import (
    BY_READINGS,
    CONTRADICTED,
    IMPOSSIBLE,
    PATH_STEP,
    TRIED,
    Cylinder,
    Guide,
    Marks,
    Setup,
)
from winding_core.compiling import called

FloatArray = NDArray[np.float64]

# The reading of a machine that has not turned so far [rad] tells the guide's place where P0 lands.
STILL = 0.003
# Slower than this the cylinder stands, and the guide may be put anywhere [rad/s].
STANDING = 1.0e-3
# A guide that moves so many times as far as the feed, or as one turn beside the other, within a
# tenth of a radian does not exist: its readings are millimetres.
MOST_SCALE, JUDGED_AFTER = 50.0, 0.1
# Travel over commanded travel in a turn or more: outside of this the markers decide.
USUAL_SCALE = (0.7, 1.4)
# So much farther from one path than from the other a marker lies on the other [m].
CLEAR = 1.0e-3
# The next marker is overdue when so many gaps and the part of a turn in sight are past [rad].
OVERDUE_GAPS, IN_SIGHT = 1.3, 1.1
# How far the guide may stand before the contact line when P0 lands, one deviation [m], and how far
# a cable lies beside the path.
OFFSET_SIGMA, LAY_SIGMA = 5.0e-3, 1.0e-3


@called
def follow_guide(
    setup: Setup, guide: Guide, before: Cylinder, now: Cylinder, reading: float
) -> Guide:  # pragma: no cover
    """Return the guide at a frame.

    Args:
        setup: Machine and camera.
        guide: In the last frame.
        before: The cylinder in the last frame.
        now: The cylinder at this one.
        reading: Of the guide [m]; nan for none, to expect the commanded feed.
    """
    step = now.angle - before.angle
    way = guide.way + setup.advance_per_radian * step
    zero, travel, turned = guide.zero, guide.travel, guide.turned
    if not math.isfinite(reading) or (now.blind and not math.isfinite(zero)):
        return Guide(
            way, guide.reading, zero, travel, turned, guide.offset, guide.belief, guide.since
        )
    if not math.isfinite(zero):
        # P0 may have landed before: the feed was the commanded one then.
        zero = reading - way
    elif abs(turned) + abs(step) < STILL:
        turned += step
        zero = reading - way
    else:
        turned += step
        if abs(now.rate) > STANDING:
            travel += reading - guide.reading
        way = reading - zero
    return Guide(way, reading, zero, travel, turned, guide.offset, guide.belief, guide.since)


@called
def judge_guide(
    setup: Setup, guide: Guide, marks: Marks, paths: FloatArray, filled: int, angle: float
) -> Guide:  # pragma: no cover
    """Return the guide with what is to be believed of its readings.

    Args:
        setup: Machine and camera.
        guide: At this frame.
        marks: The markers.
        paths: See `Tracks`.
        filled: Places of them that are filled.
        angle: Of the cylinder [rad].
    """
    turned = abs(guide.turned)
    if guide.belief >= CONTRADICTED or turned < JUDGED_AFTER:
        return guide
    feed = setup.advance_per_radian
    most = max(abs(feed), setup.body.cable_radius / math.pi) * turned * MOST_SCALE
    if abs(guide.travel) > most:
        return _believed(guide, IMPOSSIBLE, angle)
    expected = feed * guide.turned
    least, largest = USUAL_SCALE
    usual = min(least * expected, largest * expected) <= guide.travel
    usual = usual and guide.travel <= max(least * expected, largest * expected)
    if turned < 2.0 * math.pi or usual or not marks.known[0]:
        return guide
    last = marks.known.size - 1
    while not marks.known[last]:
        last -= 1
    if last > 0:
        by_readings = abs(_off(setup, guide, marks, paths, filled, 0, last))
        by_feed = abs(_off(setup, guide, marks, paths, filled, 1, last))
        if by_readings > by_feed + CLEAR:
            return _believed(guide, CONTRADICTED, angle)
        if by_feed > by_readings + CLEAR and guide.belief == TRIED:
            return _believed(guide, BY_READINGS, angle)
    due = marks.theta[last] + OVERDUE_GAPS * mean_gap(setup, marks, last) + IN_SIGHT
    missing = last < marks.known.size - 1 and angle > due
    if missing and angle > guide.since + 2.0 * math.pi:
        return _believed(guide, BY_READINGS if guide.belief == TRIED else TRIED, angle)
    return guide


@called
def look_for_markers(guide: Guide, angle: float) -> Guide:  # pragma: no cover
    """Return the guide where P0 was found at a cylinder angle [rad]: a turn shows the others."""
    return _believed(guide, guide.belief, angle)


@called
def _believed(guide: Guide, belief: int, angle: float) -> Guide:  # pragma: no cover
    """Return the guide with another belief in its readings, decided at a cylinder angle [rad]."""
    return Guide(
        guide.way, guide.reading, guide.zero, guide.travel, guide.turned, guide.offset, belief,
        angle,
    )  # fmt: skip


@called
def _off(
    setup: Setup, guide: Guide, marks: Marks, paths: FloatArray, filled: int, row: int, n: int
) -> float:  # pragma: no cover
    """Return how much farther from P0 marker n lies than a path without any offset says [m]."""
    expected, _ = path_height(LaidCable(marks, paths[row], filled), marks.theta[n])
    if row == 0:
        expected -= guide.offset * lay_share(setup, marks.theta[n])
    return float(marks.height[n] - marks.height[0] - expected)


@called
def lay_share(setup: Setup, theta: float) -> float:  # pragma: no cover
    """Return the share of an offset of the guide that cable at a wound angle [rad] lies off."""
    return 1.0 - math.exp(-max(theta, 0.0) / setup.lag)


@called
def fit_offset(
    setup: Setup, guide: Guide, marks: Marks, paths: FloatArray, filled: int
) -> Guide:  # pragma: no cover
    """Return the guide with the offset that the known markers tell; shift the path by it."""
    if guide.belief != BY_READINGS or not marks.known[0]:
        return guide
    product, square = 0.0, (LAY_SIGMA / OFFSET_SIGMA) ** 2
    for n in range(1, marks.known.size):
        if marks.known[n]:
            share = lay_share(setup, marks.theta[n])
            product += share * _off(setup, guide, marks, paths, filled, 0, n)
            square += share * share
    offset = product / square
    for k in range(1, filled):
        paths[0, k] += (offset - guide.offset) * lay_share(setup, k * PATH_STEP)
    return Guide(
        guide.way, guide.reading, guide.zero, guide.travel, guide.turned, offset, guide.belief,
        guide.since,
    )  # fmt: skip


def guide_doubt(setup: Setup, guide: Guide, height_ratio: float) -> str:
    """Return what is wrong with the readings, empty if nothing.

    Args:
        setup: Machine and camera.
        guide: In the last frame.
        height_ratio: Of the markers' heights over those of the path, dimensionless; nan while
            none is known or they lie on it.
    """
    least, most = USUAL_SCALE
    if guide.belief == BY_READINGS:
        if not math.isfinite(guide.zero) or not (height_ratio < least or height_ratio > most):
            return ""
        return (
            f"the guide's readings contradict the pictures: the cable lies {height_ratio:.2f} "
            "times as far along the cylinder as they say"
        )
    expected = setup.advance_per_radian * guide.turned
    scale = guide.travel / expected if expected else math.inf
    if abs(scale) > MOST_SCALE:
        why = "are they millimetres instead of metres?"
        if scale < 0.0:
            why = "are they millimetres instead of metres, and is their sign reversed?"
    else:
        why = "is their sign reversed?" if scale < 0.0 else "is their scale right?"
    how = "no marker was found where they say" if guide.belief == TRIED else "the cable lies so"
    if guide.belief == IMPOSSIBLE:
        how = "no guide moves so far"
    return (
        f"the guide's readings move {scale:.3g} times as far as the commanded feed, {why} "
        f"The commanded feed is used instead: {how}"
    )
