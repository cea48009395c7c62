"""Where the visible half of a painted ring band appears, and back from there to the cable.

The camera sees the half of the band that faces it, so its centroid is not the image of the
cable's centre line: it behaves like a point at R + 1.6 r. Projected at R + r it would be wrong
by 37 to 167 mrad on a 30 mm cylinder.
"""

import math
from typing import NamedTuple

import numpy as np

from marker_tracker_node.arrays import FloatArray
from marker_tracker_node.camera.pinhole import CameraView, plane_of_point
from winding_core.compiling import called, compiled

ALONG_NODES, ALONG_WEIGHTS = np.polynomial.legendre.leggauss(2)
# The nodes around lie mirrored about their middle one: so the sines of two do for four.
_AROUND = np.transpose(np.polynomial.legendre.leggauss(5)).tolist()
(_, MIDDLE_WEIGHT), (INNER, INNER_WEIGHT), (OUTER, OUTER_WEIGHT) = _AROUND[2:]
# A turn so many radii beside a band hides nothing of it, whatever the camera's side.
HIDING_REACH = 3.0
# Cable beside cable lies a diameter away, less what a band that is cut off leaves unknown: turns
# that seem nearer, in diameters, lie on one another or are measured as one.
LEAST_APART = 0.8
SOLVE_STEPS = 8
SOLVE_TOLERANCE = 2.0e-6
# A fixed point that contracts has a slope of -1 +- 1 beyond its place; one nearer to zero comes of
# the kink where the cable leaves the bend.
STEEPEST = -0.3


class Body(NamedTuple):
    """What a band is painted on."""

    rho: float  # R + r, radius of the laid cable's centre line [m]
    cable_radius: float  # r [m]
    half_band: float  # Half of a band along the cable [m]
    # Half of what is painted around the section, pi for a whole ring [rad].
    half_around: float = math.pi


class Band(NamedTuple):
    """A band and the turns of cable beside it.

    Two turns closer than a cable diameter meet in the plane between them and cut the band off.
    """

    azimuth: float  # Of the band's middle, unwrapped [rad]
    z: float  # Axial position [m]
    slope: float  # dz/dtheta of the cable [m/rad]
    # Angle around the section where the turn on the -z side cuts the band off [rad].
    low: float = -math.pi
    high: float = math.pi  # The same on the +z side [rad]
    below: float = math.inf  # Distance of the turn on the -z side [m]
    above: float = math.inf  # Distance of the turn on the +z side [m]
    lift: float = 0.0  # How high it lies on other turns [m]


@called
def band_of(row: FloatArray) -> Band:  # pragma: no cover
    """Return the band whose fields a row holds, shape (8,)."""
    return Band(row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7])


class Section(NamedTuple):
    """A section across the cable: its centre [m], and the unit vector from there outwards."""

    x: float
    y: float
    z: float
    ex: float
    ey: float


@called
def section_at(rho: float, azimuth: float, z: float) -> Section:  # pragma: no cover
    """Return the section at an unwrapped azimuth [rad] and z [m].

    Azimuth counts from the landing; before it the cable is straight.
    """
    if azimuth < 0.0:
        return Section(rho, rho * azimuth, z, 1.0, 0.0)
    ex, ey = math.cos(azimuth), math.sin(azimuth)
    return Section(rho * ex, rho * ey, z, ex, ey)


@called
def point_around(
    section: Section, tangential: float, axial: float, c: float, s: float
) -> tuple[float, float, float]:  # pragma: no cover
    """Return a lab point [m] that lies c [m] outwards and s [m] to the +z side of a section.

    Tangential and axial are the parts of that side's unit vector, against the turn and along z.
    """
    x, y, z, ex, ey = section
    return x + c * ex - s * tangential * ey, y + c * ey + s * tangential * ex, z + s * axial


@called
def surface_point(
    rho: float, r: float, azimuth: float, z: float, slope: float, psi: float
) -> tuple[float, float, float]:  # pragma: no cover
    """Return a lab point [m] of the cable's surface, psi around its section from outside to +z."""
    norm = math.hypot(rho, slope)
    c, s = r * math.cos(psi), r * math.sin(psi)
    return point_around(section_at(rho, azimuth, z), slope / norm, rho / norm, c, s)


@called
def visible_arc(
    body: Body, band: Band, outwards: float, beside: float
) -> tuple[float, float]:  # pragma: no cover
    """Return between which angles around the section a band is seen [rad].

    From the middle of the section the camera stands so far outwards, and to the +z side [m].
    """
    r = body.cable_radius
    facing = math.atan2(beside, outwards)
    reach = math.acos(min(r / math.hypot(outwards, beside), 1.0))
    first = max(facing - reach, band.low, -body.half_around)
    last = min(facing + reach, band.high, body.half_around)
    # The turn on the camera's side stands before the part next to it.
    away = band.above if facing > 0.0 else band.below
    if away > HIDING_REACH * r:
        return first, last
    edge = away * math.cos(facing) / r - 1.0
    nearer = away * math.sin(abs(facing)) / r
    # A limb that lies behind the band's own surface ends nothing: there the two meet in a crease.
    if -1.0 < edge < 1.0 and nearer * nearer > 1.0 - edge * edge:
        hidden = abs(facing) + math.asin(edge)
        if facing > 0.0:
            last = min(last, hidden)
        else:
            first = max(first, -hidden)
    return first, last


@called
def seen_from(view: CameraView, rho: float, band: Band) -> tuple[float, float]:  # pragma: no cover
    """Return how far outwards and to its +z side of a band's middle the camera stands [m]."""
    x, y, z, ex, ey = section_at(rho, band.azimuth, band.z)
    vx, vy, vz = view.x - x, view.y - y, view.z - z
    norm = math.hypot(rho, band.slope)
    return vx * ex + vy * ey, (vy * ex - vx * ey) * band.slope / norm + vz * rho / norm


@called
def own_edges(view: CameraView, body: Body, band: Band) -> tuple[int, int]:  # pragma: no cover
    """Return whether a band's edges on its -z and +z side are seen, and not cut off, 0 or 1.

    Where turns seem to lie in one another the edge that is seen may be another turn's: what is
    measured counts as it is there.
    """
    if band.low == -math.pi and band.high == math.pi:
        return 1, 1
    if min(band.below, band.above) < LEAST_APART * 2.0 * body.cable_radius:
        return 1, 1
    outwards, beside = seen_from(view, body.rho + band.lift, band)
    facing = math.atan2(beside, outwards)
    reach = math.acos(min(body.cable_radius / math.hypot(outwards, beside), 1.0))
    first, last = max(facing - reach, -body.half_around), min(facing + reach, body.half_around)
    return int(band.low <= first), int(band.high >= last)


@compiled
def band_centroid(
    view: CameraView, body: Body, band: Band
) -> tuple[float, float, float]:  # pragma: no cover
    """Return plane coordinates of the visible centroid of a band and its area on the plane."""
    rho, r, half = body.rho + band.lift, body.cable_radius, body.half_band
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
        cx, cy, cz, ex, ey = section_at(rho, turn, band.z + slope * way)
        bx, by, bz = -tangential * ey, tangential * ex, axial
        vx, vy, vz = view.x - cx, view.y - cy, view.z - cz
        along_e = vx * ex + vy * ey
        along_b = vx * bx + vy * by + vz * bz
        first, last = visible_arc(body, band, along_e, along_b)
        if last <= first:
            continue
        # Seen from the camera the surface is its centre and so much of both directions.
        rx, ry, rz = view.right_x, view.right_y, view.right_z
        right = -(rx * vx + ry * vy + rz * vz)
        right_e, right_b = r * (rx * ex + ry * ey), r * (rx * bx + ry * by + rz * bz)
        dx, dy, dz = view.down_x, view.down_y, view.down_z
        down = -(dx * vx + dy * vy + dz * vz)
        down_e, down_b = r * (dx * ex + dy * ey), r * (dx * bx + dy * by + dz * bz)
        fx, fy, fz = view.forward_x, view.forward_y, view.forward_z
        forward = -(fx * vx + fy * vy + fz * vz)
        forward_e, forward_b = r * (fx * ex + fy * ey), r * (fx * bx + fy * by + fz * bz)
        # The outer side of the bend is longer than the centre line.
        bent = r / rho if turn > 0.0 else 0.0
        middle, spread = 0.5 * (first + last), 0.5 * (last - first)
        c_middle, s_middle = math.cos(middle), math.sin(middle)
        c_inner, s_inner = math.cos(spread * INNER), math.sin(spread * INNER)
        c_outer, s_outer = math.cos(spread * OUTER), math.sin(spread * OUTER)
        for c_node, s_node, part_around in (
            (c_outer, -s_outer, OUTER_WEIGHT),
            (c_inner, -s_inner, INNER_WEIGHT),
            (1.0, 0.0, MIDDLE_WEIGHT),
            (c_inner, s_inner, INNER_WEIGHT),
            (c_outer, s_outer, OUTER_WEIGHT),
        ):
            c = c_middle * c_node - s_middle * s_node
            s = s_middle * c_node + c_middle * s_node
            closeness = 1.0 / (forward + c * forward_e + s * forward_b)
            facet = max(c * along_e + s * along_b - r, 0.0) * (1.0 + bent * c)
            weight = length * part_around * spread * facet * closeness * closeness * closeness
            sum_a += weight * closeness * (right + c * right_e + s * right_b)
            sum_b += weight * closeness * (down + c * down_e + s * down_b)
            total += weight
    if total <= 0.0:
        return math.nan, math.nan, 0.0
    return sum_a / total, sum_b / total, total * r


@compiled
def solve_band(
    view: CameraView, body: Body, a: float, b: float, start: Band
) -> tuple[float, float]:  # pragma: no cover
    """Return azimuth [rad] and z [m] of the band whose centroid appears at a plane point (a, b)."""
    seen_a, seen_b, _area = band_centroid(view, body, start)
    return solve_seen_band(view, body, (a, b), start, (seen_a, seen_b))


@called
def solve_seen_band(
    view: CameraView,
    body: Body,
    measured: tuple[float, float],
    start: Band,
    seen: tuple[float, float],
) -> tuple[float, float]:  # pragma: no cover
    """Return what `solve_band` does, [rad] and [m], if it is known how the start is seen.

    The offset between centroid and centre line changes slowly, so a fixed point on it converges;
    from the second step on the secant of the last two takes the place of its slope.
    """
    azimuth, z, rho = start.azimuth, start.z, body.rho + start.lift
    a, b = measured
    seen_a, seen_b = seen
    step, before = 0.0, 0.0
    for k in range(SOLVE_STEPS):
        if k > 0:
            seen_a, seen_b, _area = band_centroid(view, body, moved_band(start, azimuth, z))
        section = section_at(rho, azimuth, z)
        line_a, line_b, _depth = plane_of_point(view, section.x, section.y, z)
        found, height = _back_project(view, rho, a - seen_a + line_a, b - seen_b + line_b, azimuth)
        if not math.isfinite(found):
            return math.nan, math.nan
        off = found - azimuth
        change = abs(off) + abs(height - z) / rho
        z = height
        slope = (off - before) / step if step != 0.0 else -1.0
        step, before = (off / -slope if slope < STEEPEST else off), off
        azimuth += step
        if change < SOLVE_TOLERANCE:
            break
    return azimuth, z


@called
def moved_band(band: Band, azimuth: float, z: float) -> Band:  # pragma: no cover
    """Return a band with the same turns beside it at another azimuth [rad] and z [m]."""
    return Band(azimuth, z, band.slope, band.low, band.high, band.below, band.above, band.lift)


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
    azimuth += math.tau * round((near - azimuth) / (math.tau))
    return azimuth, view.z + depth * dz
