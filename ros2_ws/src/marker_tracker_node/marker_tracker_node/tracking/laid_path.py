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
        if above < diameter:
            high = math.asin(above / diameter)
    return Band(azimuth, z, slope, low, high, below, above)
