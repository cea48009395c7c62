"""Where things should be: the laid cable's path and the gate of a band upon it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.camera.compiled import compiled
from marker_tracker_node.camera.pinhole import pixel_of_plane, plane_of_point
from marker_tracker_node.detection.band import band_centroid, centre_point, surface_point
from marker_tracker_node.tracking.state import (
    ACROSS,
    ADVANCE,
    ALONG,
    ANGLE,
    CABLE,
    GUIDE,
    HALF_BAND,
    HEIGHT,
    LAG,
    PATH_COUNT,
    PATH_SIZE,
    PATH_STEP,
    RHO,
    STATUS,
    THETA,
)

FloatArray = NDArray[np.float64]

TAIL = 0.5
RING_DEPTH = 0.65


@compiled
def extend_path(
    config: FloatArray, shared: FloatArray, path: FloatArray, angle: float, guide: float
) -> None:  # pragma: no cover
    """Lay the expected path up to a cylinder angle: dz/dtheta = (z_guide - z) / lag.

    Args:
        config: See `TrackerConfig.numbers`.
        shared: See `state`; holds angle and guide of the last frame.
        path: See `TrackerState.path`.
        angle: Cylinder angle of this frame [rad].
        guide: Guide position of this frame [m]; nan to expect the commanded feed.
    """
    if not math.isfinite(guide):
        guide = config[ADVANCE] * angle
    start, before = shared[ANGLE], shared[GUIDE]
    count = int(shared[PATH_COUNT])
    share = 1.0 - math.exp(-PATH_STEP / config[LAG])
    while count < PATH_SIZE and count * PATH_STEP <= angle:
        middle = (count - 0.5) * PATH_STEP
        part = (middle - start) / (angle - start) if angle > start else 1.0
        target = before + (guide - before) * min(max(part, 0.0), 1.0)
        path[count] = path[count - 1] + share * (target - path[count - 1])
        count += 1
    shared[PATH_COUNT] = count
    shared[GUIDE] = guide


@compiled
def path_height(
    shared: FloatArray, path: FloatArray, theta: float
) -> tuple[float, float]:  # pragma: no cover
    """Return expected z [m] and dz/dtheta [m/rad] at a wound angle."""
    last = int(shared[PATH_COUNT]) - 1
    place = theta / PATH_STEP
    if place <= 0.0 or last < 1:
        return 0.0, 0.0
    low = min(int(place), last - 1)
    slope = (path[low + 1] - path[low]) / PATH_STEP
    return path[low] + slope * (theta - low * PATH_STEP), slope


@compiled
def seen_height(
    shared: FloatArray, marks: FloatArray, path: FloatArray, theta: float
) -> tuple[float, float]:  # pragma: no cover
    """Return expected z [m] and slope, drawn through the markers that are known already."""
    height, slope = path_height(shared, path, theta)
    below, above = -1, -1
    for n in range(marks.shape[0]):
        if marks[n, STATUS] > 0.0:
            if marks[n, THETA] <= theta:
                below = n
            elif above < 0:
                above = n
    if below < 0 and above < 0:
        return height, slope
    if below < 0:
        below = above
    first = marks[below, HEIGHT] - path_height(shared, path, marks[below, THETA])[0]
    if above < 0 or above == below:
        return height + first, slope
    second = marks[above, HEIGHT] - path_height(shared, path, marks[above, THETA])[0]
    tilt = (second - first) / (marks[above, THETA] - marks[below, THETA])
    return height + first + tilt * (theta - marks[below, THETA]), slope + tilt


@compiled
def neighbours(
    config: FloatArray,
    shared: FloatArray,
    marks: FloatArray,
    path: FloatArray,
    azimuth: float,
    theta: float,
    z: float,
    slope: float,
    out: FloatArray,
) -> None:  # pragma: no cover
    """Write the distances to the turns of cable beside a band and where they cut it off.

    Two turns closer than a cable diameter meet in the plane between them.

    Args:
        config: See `TrackerConfig.numbers`.
        shared: See `state`.
        marks: See `state`.
        path: See `TrackerState.path`.
        azimuth: Of the band, unwrapped [rad].
        theta: Of the band [rad].
        z: Of the band [m].
        slope: dz/dtheta there [m/rad].
        out: Angles around the section [rad] where the turns on the -z and the +z side cut the
            band, and their distances [m].
    """
    out[0], out[1], out[2], out[3] = -math.pi, math.pi, math.inf, math.inf
    lean = config[RHO] / math.hypot(config[RHO], slope)
    diameter = 2.0 * config[CABLE]
    turn = 2.0 * math.pi
    if theta - turn > -TAIL:
        out[2] = max((z - seen_height(shared, marks, path, theta - turn)[0]) * lean, 0.0)
        if out[2] < diameter:
            out[0] = -math.asin(out[2] / diameter)
    if azimuth > turn - TAIL:
        out[3] = max((seen_height(shared, marks, path, theta + turn)[0] - z) * lean, 0.0)
        if out[3] < diameter:
            out[1] = math.asin(out[3] / diameter)


@compiled
def aim(
    view: FloatArray,
    config: FloatArray,
    azimuth: float,
    z: float,
    slope: float,
    beside: FloatArray,
    gate: FloatArray,
) -> float:  # pragma: no cover
    """Write the gate of a band and return the pixels that it should fill.

    Args:
        view: See `PinholeCamera.numbers`.
        config: See `TrackerConfig.numbers`.
        azimuth: Of the band, unwrapped [rad].
        z: Of the band [m].
        slope: dz/dtheta there [m/rad].
        beside: See `neighbours`.
        gate: See `GATE_SIZE`.
    """
    rho, r, half = config[RHO], config[CABLE], config[HALF_BAND]
    a, b, area = band_centroid(view, config, azimuth, z, slope, beside[0], beside[1])
    gate[0], gate[1] = pixel_of_plane(view, a, b)
    way = half / math.hypot(rho, slope)
    x, y, h = surface_point(rho, r, azimuth - way, z + slope * way, slope, 0.0)
    a, b, depth = plane_of_point(view, x, y, h)
    u1, v1 = pixel_of_plane(view, a, b)
    x, y, h = surface_point(rho, r, azimuth + way, z - slope * way, slope, 0.0)
    a, b, _ = plane_of_point(view, x, y, h)
    u2, v2 = pixel_of_plane(view, a, b)
    length = math.hypot(u1 - u2, v1 - v2)
    gate[2], gate[3] = (u1 - u2) / length, (v1 - v2) / length
    scale = view[12] / (depth * view[23])
    gate[7] = 0.5 * length
    # Seen from the side a ring is an ellipse: its edges lie behind the centroid by this much.
    depth = RING_DEPTH * r * math.sin(max(azimuth, 0.0))
    gate[4] = gate[7] + (config[ALONG] + max(depth, 0.0)) * scale
    gate[8] = gate[7] + (config[ALONG] + max(-depth, 0.0)) * scale
    span = (r + config[ACROSS]) * scale
    gate[5] = max(-span, _border(view, config, azimuth, z, slope, beside[0], -beside[2], gate))
    gate[6] = min(span, _border(view, config, azimuth, z, slope, beside[1], beside[3], gate))
    return float(area * view[12] * view[13] / (view[23] * view[23]))


@compiled
def _border(
    view: FloatArray,
    config: FloatArray,
    azimuth: float,
    z: float,
    slope: float,
    psi: float,
    distance: float,
    gate: FloatArray,
) -> float:  # pragma: no cover
    """Return where across a gate the band's territory ends [px].

    That is the crease with a turn that overlaps the band, or half way to one that does not.
    """
    if not math.isfinite(distance):
        return distance
    if abs(distance) < 2.0 * config[CABLE]:
        x, y, h = surface_point(config[RHO], config[CABLE], azimuth, z, slope, psi)
    else:
        x, y, h = centre_point(config[RHO], azimuth, z + 0.5 * distance)
    a, b, _depth = plane_of_point(view, x, y, h)
    u, v = pixel_of_plane(view, a, b)
    return float(gate[2] * (v - gate[1]) - gate[3] * (u - gate[0]))
