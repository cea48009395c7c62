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
    solve_band,
)
from marker_tracker_node.tracking.frame.gate_prediction import RING_DEPTH
from winding_core.compiling import called, compiled

# Rows of `band_pictures` after the picture itself; tilt and place have three.
_, TILT, _, _, PLACE, _, _, AZIMUTH, HEIGHT, CYLINDER, CABLE, BAND_WIDTH, _ROWS = range(13)
# Differences of the band model are taken over so much of the radius, and of a radian.
STEP = 1.0e-4


@compiled
def band_pictures(
    view: CameraView, body: Body, bands: FloatArray
) -> FloatArray:  # pragma: no cover
    """Return plane coordinates of bands and their derivatives.

    Camera and height move a band as they move the point that its centroid looks like. Turning it
    does not, as the part that is seen stays on the camera's side: by azimuth and radii the band
    model itself is differenced.

    Args:
        view: The camera.
        body: What the bands are painted on.
        bands: Fields of `Band`, shape (k, 7).

    Returns:
        Shape (k, 12, 2): both coordinates; then their derivatives by tilt about three axes
        [1/rad], by position along three axes [1/m], by azimuth [1/rad], z [1/m], and the
        logarithms of the radii of cylinder and cable and of the band's width.
    """
    out = np.empty((bands.shape[0], _ROWS, 2))
    r, radius = body.cable_radius, body.rho - body.cable_radius
    wider = Body(body.rho + STEP * radius, r, body.half_band, body.half_around)
    thicker = Body(body.rho + STEP * r, r * (1.0 + STEP), body.half_band, body.half_around)
    longer = Body(body.rho, r, body.half_band * (1.0 + STEP), body.half_around)
    for k in range(bands.shape[0]):
        band = _creased(body, band_of(bands[k]))
        a, b, _area = band_centroid(view, body, band)
        out[k, 0, 0], out[k, 0, 1] = a, b
        _by_camera(view, body, band, a, b, out[k])
        further = moved_band(band, band.azimuth + STEP, band.z)
        _by_difference(band_centroid(view, body, further), out[k], AZIMUTH)
        _by_difference(band_centroid(view, wider, band), out[k], CYLINDER)
        _by_difference(band_centroid(view, thicker, _creased(thicker, band)), out[k], CABLE)
        _by_difference(band_centroid(view, longer, band), out[k], BAND_WIDTH)
    return out


@compiled
def seen_again(
    view: CameraView, body: Body, other: CameraView, painted: Body, bands: FloatArray
) -> FloatArray:  # pragma: no cover
    """Return azimuth [rad] and z [m] of bands as another camera and body explain their pictures.

    Bands are rows of the fields of `Band`, shape (k, 7), measured with the first view and body.
    Those of which the other camera sees no cable stay as they were. Shape (k, 2).
    """
    out = bands[:, :2].copy()
    for k in range(bands.shape[0]):
        band = band_of(bands[k])
        a, b, _area = band_centroid(view, body, band)
        a, b = a * view.fx / other.fx, b * view.fy / other.fy
        azimuth, z = solve_band(other, painted, a, b, _creased(painted, band))
        if math.isfinite(azimuth) and math.isfinite(z):
            out[k, 0], out[k, 1] = azimuth, z
    return out


@called
def _creased(body: Body, band: Band) -> Band:  # pragma: no cover
    """Return a band as turns beside it cut it off where the cable is as thick as a body's.

    What it was measured with may be thinner: an edge that comes and goes with it would be a jump.
    """
    low, high, diameter = band.low, band.high, 2.0 * body.cable_radius
    if band.below < diameter:
        low = max(low, -math.asin(band.below / diameter))
    if band.above < diameter:
        high = min(high, math.asin(band.above / diameter))
    return Band(band.azimuth, band.z, band.slope, low, high, band.below, band.above)


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
    outside = body.rho + RING_DEPTH * body.cable_radius
    x, y = outside * math.cos(band.azimuth), outside * math.sin(band.azimuth)
    if band.azimuth < 0.0:
        x, y = outside, body.rho * band.azimuth
    _a, _b, depth = plane_of_point(view, x, y, band.z)
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
