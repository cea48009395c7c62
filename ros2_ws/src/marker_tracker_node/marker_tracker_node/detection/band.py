"""Where the visible half of a painted ring band appears, and back from there to the cable.

The camera sees the half of the band that faces it, so its centroid is not the image of the
cable's centre line: it behaves like a point at R + 1.6 r. Projected at R + r it would be wrong
by 37 to 167 mrad on a 30 mm cylinder.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from marker_tracker_node.camera.pinhole import CameraView, plane_of_point
from winding_core.compiling import called, compiled

ALONG_NODES, ALONG_WEIGHTS = np.polynomial.legendre.leggauss(2)
AROUND_NODES, AROUND_WEIGHTS = np.polynomial.legendre.leggauss(5)
# A turn so many radii beside a band hides nothing of it, whatever the camera's side.
HIDING_REACH = 3.0
SOLVE_STEPS = 8
SOLVE_TOLERANCE = 2.0e-6
# A fixed point that contracts has a slope of -1 +- 1 beyond its place; one nearer to zero comes of
# the kink where the cable leaves the bend.
STEEPEST = -0.3


class Body(NamedTuple):
    """What a band is painted on.

    Attributes:
        half_around: Half of what is painted around the section, pi for a whole ring [rad].
    """

    rho: float  # R + r, radius of the laid cable's centre line [m]
    cable_radius: float  # r [m]
    half_band: float  # Half of a band along the cable [m]
    half_around: float = math.pi


class Band(NamedTuple):
    """A band and the turns of cable beside it.

    Two turns closer than a cable diameter meet in the plane between them and cut the band off.

    Attributes:
        low: Angle around the section where the turn on the -z side cuts the band off [rad].
    """

    azimuth: float  # Of the band's middle, unwrapped [rad]
    z: float  # Axial position [m]
    slope: float  # dz/dtheta of the cable [m/rad]
    low: float = -math.pi
    high: float = math.pi  # The same on the +z side [rad]
    below: float = math.inf  # Distance of the turn on the -z side [m]
    above: float = math.inf  # Distance of the turn on the +z side [m]


@compiled
def centre_point(
    rho: float, azimuth: float, z: float
) -> tuple[float, float, float]:  # pragma: no cover
    """Return the lab point [m] of the centre line at an unwrapped azimuth.

    Azimuth counts from the landing; before it the cable is straight.
    """
    if azimuth < 0.0:
        return rho, rho * azimuth, z
    return rho * math.cos(azimuth), rho * math.sin(azimuth), z


@called
def surface_point(
    rho: float, r: float, azimuth: float, z: float, slope: float, psi: float
) -> tuple[float, float, float]:  # pragma: no cover
    """Return a lab point [m] of the cable's surface, psi around its section from outside to +z."""
    norm = math.hypot(rho, slope)
    turn = max(azimuth, 0.0)
    ex, ey = math.cos(turn), math.sin(turn)
    tangential, axial = slope / norm, rho / norm
    x, y, z = centre_point(rho, azimuth, z)
    c, s = r * math.cos(psi), r * math.sin(psi)
    return x + c * ex - s * tangential * ey, y + c * ey + s * tangential * ex, z + s * axial


@called
def visible_arc(
    body: Body, band: Band, facing: float, reach: float
) -> tuple[float, float]:  # pragma: no cover
    """Return between which angles around the section a band is seen [rad].

    Args:
        body: What the band is painted on.
        band: With the turns beside it.
        facing: Angle around the section that faces the camera [rad].
        reach: How far to either side the cable alone is seen [rad].
    """
    first = max(facing - reach, band.low, -body.half_around)
    last = min(facing + reach, band.high, body.half_around)
    # The turn on the camera's side stands before the part next to it.
    beside = band.above if facing > 0.0 else band.below
    r = body.cable_radius
    if beside > HIDING_REACH * r:
        return first, last
    edge = beside * math.cos(facing) / r - 1.0
    nearer = beside * math.sin(abs(facing)) / r
    # A limb that lies behind the band's own surface ends nothing: there the two meet in a crease.
    if -1.0 < edge < 1.0 and nearer * nearer > 1.0 - edge * edge:
        hidden = abs(facing) + math.asin(edge)
        if facing > 0.0:
            last = min(last, hidden)
        else:
            first = max(first, -hidden)
    return first, last


@compiled
def band_centroid(
    view: CameraView, body: Body, band: Band
) -> tuple[float, float, float]:  # pragma: no cover
    """Return plane coordinates of the visible centroid of a band and its area on the plane."""
    rho, r, half = body.rho, body.cable_radius, body.half_band
    azimuth, slope = band.azimuth, band.slope
    norm = math.hypot(rho, slope)
    # psi runs from the outward normal e towards b = t x e, which points to +z.
    tangential, axial = slope / norm, rho / norm
    sum_a, sum_b, total = 0.0, 0.0, 0.0
    # Where the cable leaves the bend a band has two parts, each of them smooth.
    kink = min(max(azimuth * norm, -half), half)
    parts = 2 if -half < kink < half else 1
    for i in range(parts * ALONG_NODES.size):
        part, node = divmod(i, ALONG_NODES.size)
        start = kink if part == 1 else -half
        end = kink if parts == 2 and part == 0 else half
        way = 0.5 * (start + end + (end - start) * ALONG_NODES[node]) / norm
        turn = azimuth - way
        length = 0.5 * (end - start) * ALONG_WEIGHTS[node]
        bend = max(turn, 0.0)
        ex, ey = math.cos(bend), math.sin(bend)
        bx, by, bz = -tangential * ey, tangential * ex, axial
        cx, cy, cz = centre_point(rho, turn, band.z + slope * way)
        vx, vy, vz = view.x - cx, view.y - cy, view.z - cz
        along_e = vx * ex + vy * ey
        along_b = vx * bx + vy * by + vz * bz
        facing = math.atan2(along_b, along_e)
        reach = math.acos(min(r / math.hypot(along_e, along_b), 1.0))
        first, last = visible_arc(body, band, facing, reach)
        if last <= first:
            continue
        middle, spread = 0.5 * (first + last), 0.5 * (last - first)
        for j in range(AROUND_NODES.size):
            psi = middle + spread * AROUND_NODES[j]
            c, s = math.cos(psi), math.sin(psi)
            nx, ny, nz = c * ex + s * bx, c * ey + s * by, s * bz
            px, py, pz = cx + r * nx, cy + r * ny, cz + r * nz
            wx, wy, wz = view.x - px, view.y - py, view.z - pz
            a, b, depth = plane_of_point(view, px, py, pz)
            # The outer side of the bend is longer than the centre line.
            stretch = 1.0 + r * c / rho if turn > 0.0 else 1.0
            facet = max(nx * wx + ny * wy + nz * wz, 0.0) * stretch / (depth * depth * depth)
            weight = length * AROUND_WEIGHTS[j] * spread * facet
            sum_a += weight * a
            sum_b += weight * b
            total += weight
    if total <= 0.0:
        return math.nan, math.nan, 0.0
    return sum_a / total, sum_b / total, total * r


@compiled
def solve_band(
    view: CameraView, body: Body, a: float, b: float, start: Band
) -> tuple[float, float]:  # pragma: no cover
    """Return azimuth [rad] and z [m] of the band whose centroid appears at a plane point.

    The offset between centroid and centre line changes slowly, so a fixed point on it converges;
    from the second step on the secant of the last two takes the place of its slope.

    Args:
        view: The camera.
        body: What the band is painted on.
        a: Measured plane coordinate, dimensionless.
        b: Measured plane coordinate, dimensionless.
        start: Where to start.
    """
    azimuth, z = start.azimuth, start.z
    step, before = 0.0, 0.0
    for _ in range(SOLVE_STEPS):
        seen_a, seen_b, _area = band_centroid(view, body, moved_band(start, azimuth, z))
        x, y, height = centre_point(body.rho, azimuth, z)
        line_a, line_b, _depth = plane_of_point(view, x, y, height)
        found, height = _back_project(
            view, body.rho, a - seen_a + line_a, b - seen_b + line_b, azimuth
        )
        if not math.isfinite(found):
            return math.nan, math.nan
        off = found - azimuth
        change = abs(off) + abs(height - z) / body.rho
        z = height
        if change < SOLVE_TOLERANCE:
            return found, z
        slope = (off - before) / step if step != 0.0 else -1.0
        step, before = (off / -slope if slope < STEEPEST else off), off
        azimuth += step
    return azimuth, z


@called
def moved_band(band: Band, azimuth: float, z: float) -> Band:  # pragma: no cover
    """Return a band with the same turns beside it at another azimuth [rad] and z [m]."""
    return Band(azimuth, z, band.slope, band.low, band.high, band.below, band.above)


@called
def _back_project(
    view: CameraView, rho: float, a: float, b: float, near: float
) -> tuple[float, float]:  # pragma: no cover
    """Return azimuth [rad] near a given one and z [m] where a ray meets the centre line."""
    dx = view.right_x * a + view.down_x * b + view.forward_x
    dy = view.right_y * a + view.down_y * b + view.forward_y
    dz = view.right_z * a + view.down_z * b + view.forward_z
    flat = (rho - view.x) / dx
    way = view.y + flat * dy
    if way < 0.0 and near < 1.0:
        return way / rho, view.z + flat * dz
    square = dx * dx + dy * dy
    half = view.x * dx + view.y * dy
    room = half * half - square * (view.x * view.x + view.y * view.y - rho * rho)
    if room < 0.0:
        return math.nan, math.nan
    depth = (-half - math.sqrt(room)) / square
    azimuth = math.atan2(view.y + depth * dy, view.x + depth * dx)
    azimuth += 2.0 * math.pi * round((near - azimuth) / (2.0 * math.pi))
    return azimuth, view.z + depth * dz
