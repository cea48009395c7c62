"""Where bands appear in the picture, and how that changes with camera, cylinder and cable."""

from __future__ import annotations

import math

import numpy as np

from marker_tracker_node.arrays import FloatArray
from marker_tracker_node.camera.pinhole import CameraView, plane_of_point
from marker_tracker_node.detection.band import (
    Band,
    Body,
    band_centroid,
    band_of,
    moved_band,
    own_edges,
    solve_band,
    surface_point,
)
from marker_tracker_node.tracking.frame.gate_prediction import RING_DEPTH
from winding_core.compiling import called, compiled

# Rows of `band_pictures` after the picture itself; tilt and place have three.
_, TILT, _, _, PLACE, _, _, AZIMUTH, HEIGHT, CYLINDER, CABLE, BAND_WIDTH, _ROWS = range(13)
# Differences of the band model are taken over so much of the radius, and of a radian.
STEP = 1.0e-4


@compiled
def band_pictures(
    view: CameraView, body: Body, painted: Body, bands: FloatArray
) -> FloatArray:  # pragma: no cover
    """Return plane coordinates of bands and their derivatives.

    Camera and height move a band as they move the point that its centroid looks like. Turning it
    does not, as the part that is seen stays on the camera's side: by azimuth and radii the band
    model itself is differenced.

    Args:
        view: The camera.
        body: What the bands are measured with.
        painted: What they are painted on.
        bands: Fields of `Band`, shape (k, 8).

    Returns:
        Shape (k, 12, 2): both coordinates; then their derivatives by tilt about three axes
        [1/rad], by position along three axes [1/m], by azimuth [1/rad], z [1/m], and the
        logarithms of the radii of cylinder and cable and of the band's width.
    """
    out = np.empty((bands.shape[0], _ROWS, 2))
    rho, r, half, around = painted.rho, painted.cable_radius, painted.half_band, painted.half_around
    wider = Body(rho + STEP * (rho - r), r, half, around)
    thicker = Body(rho + STEP * r, r * (1.0 + STEP), half, around)
    longer = Body(rho, r, half * (1.0 + STEP), around)
    for k in range(bands.shape[0]):
        band = _cut_again(band_of(bands[k]), body, painted)
        a, b, _area = band_centroid(view, painted, band)
        out[k, 0, 0], out[k, 0, 1] = a, b
        _by_camera(view, painted, band, a, b, out[k])
        further = moved_band(band, band.azimuth + STEP, band.z)
        _by_difference(band_centroid(view, painted, further), out[k], AZIMUTH)
        _by_difference(band_centroid(view, wider, band), out[k], CYLINDER)
        cut = _cut_again(band, painted, thicker)
        _by_difference(band_centroid(view, thicker, cut), out[k], CABLE)
        _by_difference(band_centroid(view, longer, band), out[k], BAND_WIDTH)
    return out


@compiled
def seen_again(
    view: CameraView, body: Body, other: CameraView, painted: Body, bands: FloatArray
) -> FloatArray:  # pragma: no cover
    """Return azimuth, z, low and high of bands as another camera and body explain their pictures.

    Bands are rows of the fields of `Band`, shape (k, 8), measured with the first view and body.
    Those of which the other camera sees no cable stay as they were. Shape (k, 4).
    """
    out = bands[:, np.array([0, 1, 3, 4])]
    for k in range(bands.shape[0]):
        band = band_of(bands[k])
        a, b, _area = band_centroid(view, body, band)
        a, b = a * view.fx / other.fx, b * view.fy / other.fy
        cut = _cut_again(band, body, painted)
        azimuth, z = solve_band(other, painted, a, b, cut)
        if math.isfinite(azimuth) and math.isfinite(z):
            out[k, 0], out[k, 1] = azimuth, z
            out[k, 2], out[k, 3] = cut.low, cut.high
    return out


@compiled
def own_shares(view: CameraView, body: Body, bands: FloatArray) -> FloatArray:  # pragma: no cover
    """Return which share of a way along the cylinder the centres of bands go with them.

    Each edge that is seen goes with its band, and where one is cut off nothing does. Bands are rows
    of the fields of `Band`, shape (k, 8); so is the result, shape (k,).
    """
    shares = np.ones(bands.shape[0])
    for k in range(bands.shape[0]):
        below, above = own_edges(view, body, band_of(bands[k]))
        shares[k] = 0.5 * (below + above)
    return shares


@called
def _edge(angle: float, distance: float, before: float, after: float) -> float:  # pragma: no cover
    """Return where around the section a band is cut off that was at an angle [rad] before.

    A turn lies at a distance, the cable's radius is another one than before [m]: where a gate ends
    stays where it is, and turns meet half way.
    """
    place = 0.5 * distance
    if angle < math.pi:
        place = min(place, before * math.sin(angle))
    return math.asin(place / after) if place < after else math.pi


@called
def _cut_again(band: Band, before: Body, after: Body) -> Band:  # pragma: no cover
    """Return a band measured with a body as it lies and is cut off with another one's cable."""
    low = -_edge(-band.low, band.below, before.cable_radius, after.cable_radius)
    high = _edge(band.high, band.above, before.cable_radius, after.cable_radius)
    lift = band.lift * after.cable_radius / before.cable_radius
    return Band(band.azimuth, band.z, band.slope, low, high, band.below, band.above, lift)


@called
def _by_difference(
    moved: tuple[float, float, float], out: FloatArray, row: int
) -> None:  # pragma: no cover
    """Write the derivatives that follow from a band that has moved by a step."""
    out[row, 0] = (moved[0] - out[0, 0]) / STEP
    out[row, 1] = (moved[1] - out[0, 1]) / STEP


@called
def _by_camera(
    view: CameraView, body: Body, band: Band, a: float, b: float, out: FloatArray
) -> None:  # pragma: no cover
    """Write the derivatives by tilt, position and z: those of a point of the picture at (a, b)."""
    depth_of_ring = RING_DEPTH * body.cable_radius
    rho = body.rho + band.lift
    x, y, z = surface_point(rho, depth_of_ring, band.azimuth, band.z, 0.0, 0.0)
    _a, _b, depth = plane_of_point(view, x, y, z)
    out[TILT, 0], out[TILT, 1] = a * b, 1.0 + b * b
    out[TILT + 1, 0], out[TILT + 1, 1] = -1.0 - a * a, -a * b
    out[TILT + 2, 0], out[TILT + 2, 1] = b, -a
    out[PLACE, 0] = (a * view.forward_x - view.right_x) / depth
    out[PLACE, 1] = (b * view.forward_x - view.down_x) / depth
    out[PLACE + 1, 0] = (a * view.forward_y - view.right_y) / depth
    out[PLACE + 1, 1] = (b * view.forward_y - view.down_y) / depth
    out[PLACE + 2, 0] = (a * view.forward_z - view.right_z) / depth
    out[PLACE + 2, 1] = (b * view.forward_z - view.down_z) / depth
    out[HEIGHT] = -out[PLACE + 2]
