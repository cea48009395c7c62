"""Where a band should appear in the picture: its gate, and what else reaches into that."""

from __future__ import annotations

import math
from typing import NamedTuple

from marker_tracker_node.camera.pinhole import (
    CameraView,
    pixel_of_plane,
    pixels_per_metre,
    plane_of_point,
)
from marker_tracker_node.detection.band import (
    Band,
    Section,
    band_centroid,
    point_around,
    section_at,
)
from marker_tracker_node.detection.gate import Gates, gate_place
from marker_tracker_node.tracking.frame.laid_path import LAY_SIGMA
from marker_tracker_node.tracking.state import Setup
from winding_core.compiling import called, compiled

# The visible half of a ring acts like a point this far out, in radii of the cable beyond its centre
# line: 0.57 to 0.76, see `band`.
RING_DEPTH = 0.65
# The gap to a turn of the same colour that needs no cut, and how far from it a band is cut off
# otherwise [px]: in a gap of 1.5 pixels one pixel at least is paint by less than half.
SHOWN_GAP = 1.5


class Ends(NamedTuple):
    """Where a band ends along the cable, and the parts of a section's +z side as they lie there."""

    front: Section
    back: Section
    tangential: float  # See `point_around`
    axial: float


@compiled
def predict_gate(setup: Setup, band: Band, gates: Gates, n: int) -> float:  # pragma: no cover
    """Write the gate of a band to place n and return the pixels that the band should fill."""
    camera, body = setup.camera, setup.body
    rho, r, slope = body.rho + band.lift, body.cable_radius, band.slope
    a, b, area = band_centroid(camera, body, band)
    column, row = pixel_of_plane(camera, a, b)
    norm = math.hypot(rho, slope)
    way = body.half_band / norm
    ends = Ends(
        section_at(rho, band.azimuth - way, band.z + slope * way),
        section_at(rho, band.azimuth + way, band.z - slope * way),
        slope / norm,
        rho / norm,
    )
    u1, v1, depth = _pixel_around(setup, ends, ends.front, r, 0.0, 0.0)
    u2, v2, _ = _pixel_around(setup, ends, ends.back, r, 0.0, 0.0)
    length = math.hypot(u1 - u2, v1 - v2)
    tu, tv, half = (u1 - u2) / length, (v1 - v2) / length, 0.5 * length
    scale = pixels_per_metre(camera, depth)
    # Seen from the side a ring is an ellipse: its edges lie behind the centroid by this much.
    behind = RING_DEPTH * r * math.sin(max(band.azimuth, 0.0))
    span = (r + setup.across_margin) * scale
    gates.seen_a[n], gates.seen_b[n], gates.column[n], gates.row[n] = a, b, column, row
    gates.along_u[n], gates.along_v[n], gates.half_band[n] = tu, tv, half
    gates.ahead[n] = half + (setup.along_margin + max(behind, 0.0)) * scale
    gates.behind[n] = half + (setup.along_margin + max(-behind, 0.0)) * scale
    low, lean = _territory_edge(setup, ends, band.low, -band.below, gates, n)
    gates.left[n], gates.left_lean[n] = (low, lean) if low > -span else (-span, 0.0)
    high, lean = _territory_edge(setup, ends, band.high, band.above, gates, n)
    gates.right[n], gates.right_lean[n] = (high, lean) if high < span else (span, 0.0)
    return float(area * camera.fx * camera.fy / (camera.binning * camera.binning))


@called
def _pixel_around(
    setup: Setup, ends: Ends, section: Section, c: float, s: float, beside: float
) -> tuple[float, float, float]:  # pragma: no cover
    """Return column, row [px] and depth [m] of a point around a section, `beside` it along z."""
    x, y, z = point_around(section, ends.tangential, ends.axial, c, s)
    a, b, depth = plane_of_point(setup.camera, x, y, z + beside)
    u, v = pixel_of_plane(setup.camera, a, b)
    return u, v, depth


@called
def _territory_edge(
    setup: Setup, ends: Ends, psi: float, distance: float, gates: Gates, n: int
) -> tuple[float, float]:  # pragma: no cover
    """Return where across gate n the band's territory ends [px], and its change along the gate.

    That is where the band is cut off, or half way to a turn that does not reach it.
    """
    r = setup.body.cable_radius
    c, s, beside = 0.0, 0.0, 0.5 * distance
    if abs(psi) < math.pi:
        c, s, beside = r * math.cos(psi), r * math.sin(psi), 0.0
    elif abs(distance) > 2.0 * (r + setup.across_margin + LAY_SIGMA):
        # Half way to such a turn there is nothing to keep off, wherever it lies.
        return math.copysign(math.inf, distance), 0.0
    u, v, _depth = _pixel_around(setup, ends, ends.back, c, s, beside)
    along_0, across_0 = gate_place(gates, n, u, v)
    u, v, _depth = _pixel_around(setup, ends, ends.front, c, s, beside)
    along_1, across_1 = gate_place(gates, n, u, v)
    lean = (across_1 - across_0) / (along_1 - along_0)
    return across_0 - lean * along_0, lean


class Shutter(NamedTuple):
    """How the cylinder turns while a frame is read, row by row."""

    skew: float  # Angle from a row to the next, by the picture's rows [rad]
    first: float  # Row that is read at the stamp


@called
def shutter_of(setup: Setup, rate: float, rows: int) -> Shutter:  # pragma: no cover
    """Return the shutter of a frame with a number of rows, at a cylinder's speed [rad/s]."""
    return Shutter(setup.row_time * rate, 0.0 if setup.row_time >= 0.0 else rows - 1.0)


@called
def turned_since(
    setup: Setup, shutter: Shutter, azimuth: float, z: float
) -> float:  # pragma: no cover
    """Return by how much the cylinder turned from the stamp to the row of a band [rad]."""
    if shutter.skew == 0.0:
        return 0.0
    section = section_at(setup.body.rho, azimuth, z)
    a, b, _depth = plane_of_point(setup.camera, section.x, section.y, z)
    _column, row = pixel_of_plane(setup.camera, a, b)
    return shutter.skew * (row - shutter.first)


@compiled
def axis_scale(camera: CameraView) -> float:  # pragma: no cover
    """Return the scale of the image at the cylinder's axis [px/m]."""
    return pixels_per_metre(camera, abs(camera.x))


@called
def gate_margin(setup: Setup) -> float:  # pragma: no cover
    """Return the room of a gate that may lie outside the picture [px]."""
    return setup.along_margin * axis_scale(setup.camera) - 1.0


@called
def guarded(setup: Setup, band: Band, below: bool, above: bool) -> Band:  # pragma: no cover
    """Return a band cut off before it meets the turn on its -z side, on its +z side, or both.

    Where the picture shows no gap to a turn whose band has the same colour, the last pixels may
    belong to either, and those beyond the band's own end are the farthest from its middle. What
    the mask has wrong at one edge is made up for by the other one only while both are seen: cut
    off, a band lies as far off as its free edge does.
    """
    r = setup.body.cable_radius
    guard = SHOWN_GAP / axis_scale(setup.camera)
    low, high = band.low, band.high
    if below and band.below < 2.0 * r + guard:
        low = max(low, -math.asin(max(0.5 * (band.below - 2.0 * guard) / r, 0.0)))
    if above and band.above < 2.0 * r + guard:
        high = min(high, math.asin(max(0.5 * (band.above - 2.0 * guard) / r, 0.0)))
    return Band(band.azimuth, band.z, band.slope, low, high, band.below, band.above, band.lift)


@called
def gates_meet(gates: Gates, first: int, second: int, room: float) -> bool:  # pragma: no cover
    """Return whether two gates overlap, or lie less than `room` [px] apart."""
    along, across = gate_place(gates, first, gates.column[second], gates.row[second])
    to_right = gates.column[second] > gates.column[first]
    left, right = (first, second) if to_right else (second, first)
    longest = max(gates.ahead[first], gates.behind[first]) + max(
        gates.ahead[second], gates.behind[second]
    )
    beside = gates.right[left] - gates.left[right] + room
    return bool(abs(across) < beside and abs(along) <= longest)


@called
def bands_touch(gates: Gates, first: int, second: int) -> bool:  # pragma: no cover
    """Return whether two bands whose gates meet lie beside each other."""
    along, _ = gate_place(gates, first, gates.column[second], gates.row[second])
    return bool(abs(along) < gates.half_band[first] + gates.half_band[second])


@called
def separate_gates(gates: Gates, first: int, second: int) -> None:  # pragma: no cover
    """Keep two gates that overlap off each other's band along the cable."""
    if not gates_meet(gates, first, second, 0.0) or bands_touch(gates, first, second):
        return
    along, _ = gate_place(gates, first, gates.column[second], gates.row[second])
    for mine, other in ((first, second), (second, first)):
        limit = abs(along) - gates.half_band[other]
        gates.ahead[mine] = min(gates.ahead[mine], limit)
        gates.behind[mine] = min(gates.behind[mine], limit)
