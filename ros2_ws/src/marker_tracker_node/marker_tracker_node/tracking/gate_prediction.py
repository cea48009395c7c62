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
from marker_tracker_node.detection.band import Band, band_centroid, centre_point, surface_point
from marker_tracker_node.detection.gate import Gates, Picture, gate_leaves_image
from marker_tracker_node.tracking.state import Setup
from winding_core.compiling import called, compiled

RING_DEPTH = 0.65
TOUCH_REACH = 1.5

# What comes of looking for a band; HIDDEN until it has been measured, PARTLY where light hides a
# part of it.
OUT_OF_SIGHT, CLIPPED, HIDDEN, MEASURED, PARTLY = range(5)


@compiled
def predict_gate(setup: Setup, band: Band, gates: Gates, n: int) -> float:  # pragma: no cover
    """Write the gate of a band to place n and return the pixels that the band should fill."""
    camera, body = setup.camera, setup.body
    a, b, area = band_centroid(camera, body, band)
    gates.column[n], gates.row[n] = pixel_of_plane(camera, a, b)
    way = body.half_band / math.hypot(body.rho, band.slope)
    u1, v1, depth = _surface_pixel(setup, band, way)
    u2, v2, _ = _surface_pixel(setup, band, -way)
    length = math.hypot(u1 - u2, v1 - v2)
    gates.along_u[n], gates.along_v[n] = (u1 - u2) / length, (v1 - v2) / length
    half = 0.5 * length
    gates.half_band[n] = half
    scale = pixels_per_metre(camera, depth)
    # Seen from the side a ring is an ellipse: its edges lie behind the centroid by this much.
    behind = RING_DEPTH * body.cable_radius * math.sin(max(band.azimuth, 0.0))
    gates.ahead[n] = half + (setup.along_margin + max(behind, 0.0)) * scale
    gates.behind[n] = half + (setup.along_margin + max(-behind, 0.0)) * scale
    span = (body.cable_radius + setup.across_margin) * scale
    gates.left[n] = max(-span, _territory_edge(setup, band, band.low, -band.below, gates, n))
    gates.right[n] = min(span, _territory_edge(setup, band, band.high, band.above, gates, n))
    return float(area * camera.fx * camera.fy / (camera.binning * camera.binning))


@called
def _surface_pixel(
    setup: Setup, band: Band, way: float
) -> tuple[float, float, float]:  # pragma: no cover
    """Return column, row [px] and depth [m] of the outside of the cable, `way` before a band."""
    rho, r = setup.body.rho, setup.body.cable_radius
    x, y, z = surface_point(rho, r, band.azimuth - way, band.z + band.slope * way, band.slope, 0.0)
    a, b, depth = plane_of_point(setup.camera, x, y, z)
    u, v = pixel_of_plane(setup.camera, a, b)
    return u, v, depth


@called
def _territory_edge(
    setup: Setup, band: Band, psi: float, distance: float, gates: Gates, n: int
) -> float:  # pragma: no cover
    """Return where across gate n the band's territory ends [px].

    That is the crease with a turn that overlaps the band, or half way to one that does not.
    """
    if not math.isfinite(distance):
        return distance
    rho, r = setup.body.rho, setup.body.cable_radius
    if abs(distance) < 2.0 * r:
        x, y, z = surface_point(rho, r, band.azimuth, band.z, band.slope, psi)
    else:
        x, y, z = centre_point(rho, band.azimuth, band.z + 0.5 * distance)
    a, b, _depth = plane_of_point(setup.camera, x, y, z)
    u, v = pixel_of_plane(setup.camera, a, b)
    du, dv = u - gates.column[n], v - gates.row[n]
    return float(gates.along_u[n] * dv - gates.along_v[n] * du)


class Shutter(NamedTuple):
    """How the cylinder turns while a frame is read, row by row.

    Attributes:
        skew: Angle from a row to the next, by the picture's rows [rad].
        first: Row that is read at the stamp.
    """

    skew: float
    first: float


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
    x, y, height = centre_point(setup.body.rho, azimuth, z)
    a, b, _depth = plane_of_point(setup.camera, x, y, height)
    _column, row = pixel_of_plane(setup.camera, a, b)
    return shutter.skew * (row - shutter.first)


@compiled
def axis_scale(camera: CameraView) -> float:  # pragma: no cover
    """Return the scale of the image at the cylinder's axis [px/m]."""
    return pixels_per_metre(camera, abs(camera.x))


@called
def gate_visibility(
    setup: Setup, gates: Gates, n: int, picture: Picture
) -> int:  # pragma: no cover
    """Return OUT_OF_SIGHT, CLIPPED or HIDDEN (nothing found yet) for gate n."""
    margin = setup.along_margin * axis_scale(setup.camera) - 1.0
    partly, wholly = gate_leaves_image(gates, n, margin, picture)
    if wholly:
        return OUT_OF_SIGHT
    return CLIPPED if partly else HIDDEN


@called
def separate_gates(gates: Gates, first: int, second: int) -> bool:  # pragma: no cover
    """Keep two gates off each other's band along the cable and return whether the bands touch."""
    du = gates.column[second] - gates.column[first]
    dv = gates.row[second] - gates.row[first]
    along = abs(du * gates.along_u[first] + dv * gates.along_v[first])
    across = abs(gates.along_u[first] * dv - gates.along_v[first] * du)
    left, right = (first, second) if du > 0.0 else (second, first)
    reach = gates.right[left] - gates.left[right] + TOUCH_REACH
    longest = max(gates.ahead[first], gates.behind[first]) + max(
        gates.ahead[second], gates.behind[second]
    )
    if across > reach or along > longest:
        return False
    if along < gates.half_band[first] + gates.half_band[second]:
        return True
    for mine, other in ((first, second), (second, first)):
        limit = along - gates.half_band[other]
        gates.ahead[mine] = min(gates.ahead[mine], limit)
        gates.behind[mine] = min(gates.behind[mine], limit)
    return False
