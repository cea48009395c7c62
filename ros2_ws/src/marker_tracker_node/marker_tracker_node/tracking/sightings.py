"""Every measured band of a run, and the pictures that bands would give with another pose."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.camera.pinhole import (
    CameraPose,
    CameraView,
    PinholeCamera,
    pixel_of_plane,
    plane_of_pixel,
    plane_of_point,
)
from marker_tracker_node.detection.band import (
    Band,
    Body,
    band_centroid,
    centre_point,
    surface_point,
)
from winding_core.compiling import called, compiled

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]

# Fields of the turns beside a band, and of its gate.
_BESIDE = ("low", "high", "below", "above", "left", "right")
# After so many steps where a gate's edge meets a cable is known to 0.1 mrad.
EDGE_STEPS = 6
# A gate holds something of its band: no more than to this sine beyond the middle is cut away.
MOST_CUT = 0.9


@dataclass(frozen=True, kw_only=True)
class Sightings:
    """Every measured band of a run, one row each.

    Attributes:
        left: Column where the gate ended at -z [px], shape (k,); nan for an outline that was fitted
            beyond its gate.
        mean_theta: Run mean of each marker's wound angle from P0 [rad], shape (markers,), nan for
            one that is not known.
    """

    marker: IndexArray  # Number n, shape (k,)
    angle: FloatArray  # Cylinder angle of its frame [rad], shape (k,)
    azimuth: FloatArray  # As seen with `pose` [rad], unwrapped, shape (k,)
    z: FloatArray  # As seen with `pose` [m], shape (k,)
    slope: FloatArray  # dz/dtheta of the cable there [m/rad], shape (k,)
    low: FloatArray  # Cut by the neighbouring turn at -z, see `Band` [rad], shape (k,)
    high: FloatArray  # The same at +z, shape (k,)
    below: FloatArray  # Distance of the turn at -z, see `Band` [m], shape (k,)
    above: FloatArray  # The same at +z, shape (k,)
    left: FloatArray
    right: FloatArray  # The same at +z, shape (k,)
    pose: CameraPose  # Of the camera with which azimuth and z were computed
    mean_theta: FloatArray
    mean_z: FloatArray  # Run mean of z from P0 [m], likewise

    def every(self, stride: int) -> Sightings:
        """Return one sighting in `stride`."""
        rows = ("marker", "angle", "azimuth", "z", "slope", *_BESIDE)
        return replace(self, **{name: getattr(self, name)[::stride] for name in rows})


class GatedBands:
    """Bands as they were measured: what lies outside of a gate was not counted.

    A gate stays where it is in its picture, wherever the band lies in truth.

    Attributes:
        measured: Plane coordinates of what was measured, shape (k, 2).
    """

    def __init__(self, camera: PinholeCamera, body: Body, sightings: Sightings) -> None:
        """Take sightings apart into what the pictures showed."""
        self._camera, self._body, self._sightings = camera, body, sightings
        s, view = sightings, camera.view(sightings.pose)
        self.measured = self._held(view, s.azimuth, s.z, s.low, s.high)
        self._left = _edges(view, body, s.azimuth, s.z, s.slope, s.low, s.left, self.measured)
        self._right = _edges(view, body, s.azimuth, s.z, s.slope, s.high, s.right, self.measured)

    def pictures(self, pose: CameraPose, azimuth: FloatArray, z: FloatArray) -> FloatArray:
        """Return plane coordinates of what the gates hold of bands that lie elsewhere.

        Args:
            pose: Of the camera.
            azimuth: Of the bands [rad], shape (k,).
            z: Of the bands [m], shape (k,).
        """
        s, view = self._sightings, self._camera.view(pose)
        low = _cuts(view, self._body, azimuth, z, s.slope, s.low, self._left, -1.0)
        high = _cuts(view, self._body, azimuth, z, s.slope, s.high, self._right, 1.0)
        return self._held(view, azimuth, z, low, high)

    def _held(
        self,
        view: CameraView,
        azimuth: FloatArray,
        z: FloatArray,
        low: FloatArray,
        high: FloatArray,
    ) -> FloatArray:
        s = self._sightings
        return _band_pictures(view, self._body, azimuth, z, s.slope, low, high, s.below, s.above)


@compiled
def _band_pictures(
    view: CameraView,
    body: Body,
    azimuth: FloatArray,
    z: FloatArray,
    slope: FloatArray,
    low: FloatArray,
    high: FloatArray,
    below: FloatArray,
    above: FloatArray,
) -> FloatArray:  # pragma: no cover
    """Return plane coordinates of the visible centroid of each sighting, shape (k, 2)."""
    out = np.empty((azimuth.size, 2))
    for k in range(azimuth.size):
        band = Band(azimuth[k], z[k], slope[k], low[k], high[k], below[k], above[k])
        out[k, 0], out[k, 1], _area = band_centroid(view, body, band)
    return out


@compiled
def _edges(
    view: CameraView,
    body: Body,
    azimuth: FloatArray,
    z: FloatArray,
    slope: FloatArray,
    cut: FloatArray,
    column: FloatArray,
    measured: FloatArray,
) -> FloatArray:  # pragma: no cover
    """Return the edges of gates on the plane, shape (k, 2).

    Each is a line that runs with the cable: its first coordinate where the second is zero, nan for
    none, and how much that grows with the second.
    """
    out = np.empty((column.size, 2))
    for k in range(column.size):
        _column, row = pixel_of_plane(view, measured[k, 0], measured[k, 1])
        a, b = plane_of_pixel(view, column[k], row)
        psi = cut[k] if abs(cut[k]) < math.pi else 0.0
        way = body.half_band / math.hypot(body.rho, slope[k])
        x1, y1, z1 = surface_point(
            body.rho, body.cable_radius, azimuth[k] - way, z[k] + slope[k] * way, slope[k], psi
        )
        x2, y2, z2 = surface_point(
            body.rho, body.cable_radius, azimuth[k] + way, z[k] - slope[k] * way, slope[k], psi
        )
        a1, b1, _depth = plane_of_point(view, x1, y1, z1)
        a2, b2, _depth = plane_of_point(view, x2, y2, z2)
        lean = (a1 - a2) / (b1 - b2)
        out[k, 0], out[k, 1] = a - lean * b, lean
    return out


@compiled
def _cuts(
    view: CameraView,
    body: Body,
    azimuth: FloatArray,
    z: FloatArray,
    slope: FloatArray,
    otherwise: FloatArray,
    edge: FloatArray,
    side: float,
) -> FloatArray:  # pragma: no cover
    """Return where around the section the edges of gates cut bands off [rad], shape (k,).

    Args:
        view: The camera.
        body: What the bands are painted on.
        azimuth: Of the bands [rad], shape (k,).
        z: Of the bands [m], shape (k,).
        slope: dz/dtheta there [m/rad], shape (k,).
        otherwise: What is taken where an edge is nan [rad], shape (k,).
        edge: See `_edges`, shape (k, 2).
        side: Of the cable, -1 or 1.
    """
    out = np.empty(azimuth.size)
    for k in range(azimuth.size):
        if math.isnan(edge[k, 0]):
            out[k] = otherwise[k]
        else:
            out[k] = _cut(view, body, azimuth[k], z[k], slope[k], edge[k, 0], edge[k, 1], side)
    return out


@called
def _cut(
    view: CameraView,
    body: Body,
    azimuth: float,
    z: float,
    slope: float,
    edge: float,
    lean: float,
    side: float,
) -> float:  # pragma: no cover
    """Return where around the section a line of the picture lies [rad]; beyond its limb for none.

    Counted from the angle that faces the camera the sine goes with the picture, and a line that
    leaves the cable does so without a step.
    """
    rho, r = body.rho, body.cable_radius
    norm = math.hypot(rho, slope)
    turn = max(azimuth, 0.0)
    ex, ey = math.cos(turn), math.sin(turn)
    x, y, height = centre_point(rho, azimuth, z)
    vx, vy, vz = view.x - x, view.y - y, view.z - height
    along_b = (vy * ex - vx * ey) * slope / norm + vz * rho / norm
    facing = math.atan2(along_b, vx * ex + vy * ey)
    sine, psi = 0.0, facing
    for _ in range(EDGE_STEPS):
        x, y, height = surface_point(rho, r, azimuth, z, slope, psi)
        a, b, depth = plane_of_point(view, x, y, height)
        off = side * (sine + (edge + lean * b - a) * depth / r)
        sine = side * min(max(off, -MOST_CUT), 1.0)
        psi = facing + math.asin(sine)
    return psi
