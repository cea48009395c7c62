"""Where the laid cable should be: the fleet-angle law, drawn through the known markers."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.detection.band import Band
from marker_tracker_node.tracking.state import PATH_SIZE, PATH_STEP, Marks, Run, Setup
from winding_core.compiling import called

FloatArray = NDArray[np.float64]

TAIL = 0.5
# Before the contact line the free span stands off the cylinder: within these azimuths [rad] it
# hangs before the turn beside it, nearer to the line it lies beside that.
SPAN_FIRST, SPAN_LAST = -1.3, -0.3
# What the expected path may be wrong by before a turn has landed [m].
SPAN_ROOM = 1.0e-3
# A marker that is not known yet shows this far beside the place where it may be [rad].
STRANGER_REACH = 0.4
# The next marker is no nearer than this share of the mean gap.
LEAST_GAP = 0.6


class LaidCable(NamedTuple):
    """The cable on the cylinder as far as it is known.

    Attributes:
        marks: The markers.
        path: See `Tracks`.
        filled: Places of the path that are filled.
    """

    marks: Marks
    path: FloatArray
    filled: int


@called
def extend_path(
    setup: Setup, path: FloatArray, run: Run, angle: float, guide: float
) -> tuple[int, float]:  # pragma: no cover
    """Lay the expected path up to a cylinder angle: dz/dtheta = (z_guide - z) / lag.

    Args:
        setup: Machine and camera.
        path: See `Tracks`.
        run: Of the last frame.
        angle: Cylinder angle of this frame [rad].
        guide: Guide position of this frame [m]; nan to expect the commanded feed.

    Returns:
        Filled places of the path and the guide position that was used [m].
    """
    if not math.isfinite(guide):
        guide = setup.advance_per_radian * angle
    start, before, count = run.cylinder.angle, run.guide, run.path_filled
    share = 1.0 - math.exp(-PATH_STEP / setup.lag)
    while count < PATH_SIZE and count * PATH_STEP <= angle:
        middle = (count - 0.5) * PATH_STEP
        part = (middle - start) / (angle - start) if angle > start else 1.0
        target = before + (guide - before) * min(max(part, 0.0), 1.0)
        path[count] = path[count - 1] + share * (target - path[count - 1])
        count += 1
    return count, guide


@called
def path_height(cable: LaidCable, theta: float) -> tuple[float, float]:  # pragma: no cover
    """Return expected z [m] and dz/dtheta [m/rad] at a wound angle."""
    last = cable.filled - 1
    place = theta / PATH_STEP
    if place <= 0.0 or last < 1:
        return 0.0, 0.0
    low = min(int(place), last - 1)
    slope = (cable.path[low + 1] - cable.path[low]) / PATH_STEP
    return cable.path[low] + slope * (theta - low * PATH_STEP), slope


@called
def mean_gap(setup: Setup, marks: Marks, last: int) -> float:  # pragma: no cover
    """Return the wound angle between markers [rad]: measured so far, or else expected."""
    if last > 0:
        return float((marks.theta[last] - marks.theta[0]) / last)
    return setup.expected_gap


@called
def known_around(marks: Marks, theta: float) -> tuple[int, int]:  # pragma: no cover
    """Return the numbers of the known markers below and above a wound angle, -1 for none."""
    below, above = -1, -1
    for n in range(marks.known.size):
        if marks.known[n]:
            if marks.theta[n] <= theta:
                below = n
            elif above < 0:
                above = n
    return below, above


@called
def corrected_height(cable: LaidCable, theta: float) -> tuple[float, float]:  # pragma: no cover
    """Return expected z [m] and slope, drawn through the markers that are known already."""
    height, slope = path_height(cable, theta)
    marks = cable.marks
    below, above = known_around(marks, theta)
    if below < 0 and above < 0:
        return height, slope
    if below < 0:
        below = above
    first = marks.height[below] - path_height(cable, marks.theta[below])[0]
    if above < 0 or above == below:
        return height + first, slope
    second = marks.height[above] - path_height(cable, marks.theta[above])[0]
    tilt = (second - first) / (marks.theta[above] - marks.theta[below])
    return height + first + tilt * (theta - marks.theta[below]), slope + tilt


@called
def band_beside_turns(
    setup: Setup, cable: LaidCable, azimuth: float, theta: float, z: float, slope: float
) -> Band:  # pragma: no cover
    """Return a band with the turns of cable that lie beside it.

    Args:
        setup: Machine and camera.
        cable: As laid so far.
        azimuth: Of the band, unwrapped [rad].
        theta: Of the band [rad].
        z: Of the band [m].
        slope: dz/dtheta there [m/rad].
    """
    low, high, below, above = -math.pi, math.pi, math.inf, math.inf
    lean = setup.body.rho / math.hypot(setup.body.rho, slope)
    diameter = 2.0 * setup.body.cable_radius
    turn = 2.0 * math.pi
    if theta - turn > -TAIL:
        below = max((z - corrected_height(cable, theta - turn)[0]) * lean, 0.0)
        if below < diameter:
            low = -math.asin(below / diameter)
    if azimuth > turn - TAIL:
        above = max((corrected_height(cable, theta + turn)[0] - z) * lean, 0.0)
        if known_around(cable.marks, theta + turn)[1] < 0:
            # Beyond the last marker the path is only expected: no turn lies in the one before.
            above = max(above, diameter)
        if above < diameter:
            high = math.asin(above / diameter)
    return Band(azimuth, z, slope, low, high, below, above)


@called
def covered_by_span(
    setup: Setup, cable: LaidCable, band: Band, theta: float
) -> bool:  # pragma: no cover
    """Return whether the cable that is about to land hangs before a band at a wound angle [rad]."""
    before = band.azimuth - 2.0 * math.pi
    if not SPAN_FIRST < before < SPAN_LAST:
        return False
    # The path goes on past the landing with the slope of the free span.
    landing = theta + 2.0 * math.pi + before
    way = landing + math.sin(-before)
    distance = corrected_height(cable, way)[0] - band.z
    return bool(distance < 2.0 * setup.body.cable_radius + SPAN_ROOM)


@called
def stranger_beside(setup: Setup, cable: LaidCable, theta: float) -> bool:  # pragma: no cover
    """Return whether a marker that is not known yet may lie a turn behind a wound angle [rad]."""
    marks = cable.marks
    last = marks.known.size - 1
    while last >= 0 and not marks.known[last]:
        last -= 1
    if last < 0 or last == marks.known.size - 1:
        return False
    least = marks.theta[last] + LEAST_GAP * mean_gap(setup, marks, last)
    return bool(theta + 2.0 * math.pi + STRANGER_REACH > least)
