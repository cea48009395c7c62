"""The camera as the tracker knows it: what CameraInfo holds, and where the camera stands."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from marker_tracker_node.arrays import FloatArray
from winding_core.compiling import called, compiled
from winding_core.markers import positions

PLUMB_BOB = "plumb_bob"
UNDISTORTION_STEPS = 30
UNDISTORTION_TOLERANCE = 1.0e-13


class CameraView(NamedTuple):
    """Pose, lens and window of a camera, as the kernels take them.

    Right, down and forward are the camera's axes in the lab frame, x, y and z its projection
    centre [m], f and c focal lengths and principal point [px], k1 to p2 the plumb_bob distortion,
    and the offsets those of the window on the sensor [px].
    """

    right_x: float
    right_y: float
    right_z: float
    down_x: float
    down_y: float
    down_z: float
    forward_x: float
    forward_y: float
    forward_z: float
    x: float
    y: float
    z: float
    fx: float
    fy: float
    cx: float
    cy: float
    k1: float
    k2: float
    p1: float
    p2: float
    k3: float
    column_offset: float
    row_offset: float
    binning: float


@dataclass(frozen=True, kw_only=True)
class CameraPose:
    """Where the camera stands in the lab frame.

    Nominally it stands at +x and looks along -x, image x along +z, image y along +y.
    """

    position: tuple[float, float, float] = (0.4175, 0.0, 0.05)  # Of the projection centre [m]
    # Rotation vector about the camera's own axes from the nominal orientation [rad].
    tilt: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if not np.isfinite([*self.position, *self.tilt]).all():
            raise ValueError(f"pose must be finite, got {self.position} and {self.tilt}")

    @classmethod
    def of(cls, numbers: FloatArray) -> CameraPose:
        """Return the pose of this tilt [rad] and position [m], shape (6,)."""
        a, b, c, x, y, z = numbers.tolist()
        return cls(tilt=(a, b, c), position=(x, y, z))

    @property
    def numbers(self) -> FloatArray:
        """Tilt [rad] and position [m], shape (6,)."""
        return np.array([*self.tilt, *self.position])

    @property
    def axes(self) -> FloatArray:
        """Right, down and forward axes of the camera in the lab frame as rows, shape (3, 3)."""
        nominal = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
        wx, wy, wz = self.tilt
        angle = math.sqrt(wx * wx + wy * wy + wz * wz)
        skew = np.array([[0.0, -wz, wy], [wz, 0.0, -wx], [-wy, wx, 0.0]])
        sine = math.sin(angle) / angle if angle > 0.0 else 1.0
        versine = (1.0 - math.cos(angle)) / angle**2 if angle > 0.0 else 0.5
        turn = np.eye(3) + sine * skew + versine * (skew @ skew)
        return np.asarray(turn.T @ nominal, dtype=float)


@dataclass(frozen=True, kw_only=True)
class PinholeCamera:
    """Content of a sensor_msgs/CameraInfo, in full-resolution pixels (REP-104).

    Pixel centres lie at whole numbers and a binned pixel is the mean of binning x binning raw
    ones, so column i of the image has its centre at x_offset + binning (i + 1/2) - 1/2.

    Raises:
        ValueError: The camera is not calibrated (K[0] = 0), or a field contradicts another.
    """

    width: int  # Columns of the full sensor
    height: int  # Rows of the full sensor
    k: FloatArray  # Camera matrix, shape (3, 3); given in any shape
    d: FloatArray  # plumb_bob distortion k1, k2, p1, p2, k3, shape (5,); given empty for none
    # x_offset, y_offset, width, height; given without a size for the whole sensor.
    roi: tuple[int, int, int, int] = (0, 0, 0, 0)
    binning: int = 1  # Raw pixels per image pixel; zero counts as one
    distortion_model: str = PLUMB_BOB  # "plumb_bob"

    def __post_init__(self) -> None:
        whole = (0, 0, self.width, self.height)
        distortion = np.array(self.d, dtype=float).ravel()
        given = {
            "k": np.array(self.k, dtype=float).reshape(3, 3),
            "d": distortion if distortion.size else np.zeros(5),
            "roi": whole if 0 in self.roi[2:] else self.roi,
            "binning": max(self.binning, 1),
        }
        for name, value in given.items():
            object.__setattr__(self, name, value)
        if not np.isfinite(self.k).all() or self.k[0, 0] <= 0.0 or self.k[1, 1] <= 0.0:
            raise ValueError(f"camera is not calibrated: K[0] is {self.k[0, 0]}")
        if self.distortion_model != PLUMB_BOB:
            raise ValueError(
                f"distortion_model must be {PLUMB_BOB!r}, got {self.distortion_model!r}"
            )
        if self.d.shape != (5,) or not np.isfinite(self.d).all():
            raise ValueError(f"plumb_bob needs 5 finite coefficients, got {self.d.tolist()}")
        x, y, width, height = self.roi
        if min(x, y) < 0 or x + width > self.width or y + height > self.height:
            raise ValueError(f"roi {self.roi} leaves the sensor of {self.width} x {self.height}")
        if min(self.shape) < 1:
            raise ValueError(f"roi {self.roi} with binning {self.binning} holds no pixel")
        self._require_invertible()

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of an image."""
        return self.roi[3] // self.binning, self.roi[2] // self.binning

    def view(self, pose: CameraPose) -> CameraView:
        """Return pose, lens and window for the kernels."""
        k = self.k
        return CameraView._make(
            float(number)
            for number in (
                *pose.axes.ravel(),
                *pose.position,
                *(k[0, 0], k[1, 1], k[0, 2], k[1, 2]),
                *self.d,
                *self.roi[:2],
                self.binning,
            )
        )

    def pixels(self, points: ArrayLike, pose: CameraPose | None = None) -> FloatArray:
        """Return columns and rows in the image of lab points or markers, shape (n, 2) [px].

        Args:
            points: Lab frame [m], shape (n, 3), or marker records, shape (n,). Those on the far
                side of the cylinder have pixels too; a marker that is not known has nan.
            pose: Where the camera stands; None for the nominal place.
        """
        view = self.view(pose or CameraPose())
        places = np.asarray(points)
        if places.dtype.names:
            places = positions(places)
        planes = [plane_of_point(view, *place)[:2] for place in places.reshape(-1, 3).tolist()]
        found = [pixel_of_plane(view, *plane) for plane in planes]
        return np.array(found, dtype=float).reshape(-1, 2)

    def _radial_reach(self) -> float:
        """Return the radius in the picture, over the focal length, that no ray goes beyond.

        The radial part r (1 + k1 r^2 + k2 r^4 + k3 r^6) of plumb_bob grows with r only up to there.
        """
        k1, k2, k3 = (float(self.d[k]) for k in (0, 1, 4))
        # Of the inverse square: the first coefficient is then one, however small the others are.
        turns = np.roots([1.0, 3.0 * k1, 5.0 * k2, 7.0 * k3])
        inverse = turns.real[np.abs(turns.imag) < 1.0e-9 * turns.real]
        # No picture reaches a thousand focal lengths.
        if inverse.max(initial=0.0) < 1.0e-6:
            return math.inf
        q = 1.0 / float(inverse.max())
        return math.sqrt(q) * (1.0 + q * (k1 + q * (k2 + q * k3)))

    def _require_invertible(self) -> None:
        """Refuse a distortion that folds the image over itself within the region used."""
        view = self.view(CameraPose())
        rows, columns = self.shape
        # The farthest pixel from the centre is a corner of the window.
        x, y, width, height = self.roi
        farthest = max(
            math.hypot((u - self.k[0, 2]) / self.k[0, 0], (v - self.k[1, 2]) / self.k[1, 1])
            for u in (x - 0.5, x + width - 0.5)
            for v in (y - 0.5, y + height - 0.5)
        )
        reach = self._radial_reach()
        if reach < farthest:
            raise ValueError(
                f"distortion {self.d.tolist()} folds the picture "
                f"{reach * self.k[0, 0]:.0f} px from its centre, and it reaches "
                f"{farthest * self.k[0, 0]:.0f} px: no lens does that"
            )
        for u in np.linspace(-0.5, columns - 0.5, 17):
            for v in np.linspace(-0.5, rows - 0.5, 9):
                a, b = plane_of_pixel(view, u, v)
                back = pixel_of_plane(view, a, b)
                if not (abs(back[0] - u) < 1.0e-6 and abs(back[1] - v) < 1.0e-6):
                    raise ValueError(
                        f"distortion {self.d.tolist()} cannot be inverted at pixel "
                        f"({u:.1f}, {v:.1f})"
                    )


@called
def pixels_per_metre(view: CameraView, depth: float) -> float:  # pragma: no cover
    """Return the scale of the image [px/m] at a depth [m]."""
    return view.fx / (depth * view.binning)


@compiled
def plane_of_point(
    view: CameraView, x: float, y: float, z: float
) -> tuple[float, float, float]:  # pragma: no cover
    """Return undistorted plane coordinates and depth [m] of a lab point."""
    dx, dy, dz = x - view.x, y - view.y, z - view.z
    depth = view.forward_x * dx + view.forward_y * dy + view.forward_z * dz
    a = (view.right_x * dx + view.right_y * dy + view.right_z * dz) / depth
    b = (view.down_x * dx + view.down_y * dy + view.down_z * dz) / depth
    return a, b, depth


@compiled
def pixel_of_plane(view: CameraView, a: float, b: float) -> tuple[float, float]:  # pragma: no cover
    """Return column and row [pixels] in the image of undistorted plane coordinates."""
    k1, k2, p1, p2, k3 = view.k1, view.k2, view.p1, view.p2, view.k3
    q = a * a + b * b
    radial = 1.0 + k1 * q + k2 * q * q + k3 * q * q * q
    u = a * radial + 2.0 * p1 * a * b + p2 * (q + 2.0 * a * a)
    v = b * radial + p1 * (q + 2.0 * b * b) + 2.0 * p2 * a * b
    column = (view.fx * u + view.cx - view.column_offset + 0.5) / view.binning - 0.5
    row = (view.fy * v + view.cy - view.row_offset + 0.5) / view.binning - 0.5
    return column, row


@compiled
def plane_of_pixel(
    view: CameraView, column: float, row: float
) -> tuple[float, float]:  # pragma: no cover
    """Return undistorted plane coordinates of an image pixel, by Newton's method.

    Five fixed-point steps, the habit of the trade, leave 0.4 px at k1 = -0.35.
    """
    k1, k2, p1, p2, k3 = view.k1, view.k2, view.p1, view.p2, view.k3
    u = (view.column_offset + view.binning * (column + 0.5) - 0.5 - view.cx) / view.fx
    v = (view.row_offset + view.binning * (row + 0.5) - 0.5 - view.cy) / view.fy
    a, b = u, v
    for _ in range(UNDISTORTION_STEPS):
        q = a * a + b * b
        radial = 1.0 + k1 * q + k2 * q * q + k3 * q * q * q
        slope = 2.0 * (k1 + 2.0 * k2 * q + 3.0 * k3 * q * q)
        f = a * radial + 2.0 * p1 * a * b + p2 * (q + 2.0 * a * a) - u
        g = b * radial + p1 * (q + 2.0 * b * b) + 2.0 * p2 * a * b - v
        if abs(f) < UNDISTORTION_TOLERANCE and abs(g) < UNDISTORTION_TOLERANCE:
            break
        faa = radial + slope * a * a + 2.0 * p1 * b + 6.0 * p2 * a
        fab = slope * a * b + 2.0 * p1 * a + 2.0 * p2 * b
        fbb = radial + slope * b * b + 6.0 * p1 * b + 2.0 * p2 * a
        det = faa * fbb - fab * fab
        if det == 0.0:
            return math.nan, math.nan
        a -= (fbb * f - fab * g) / det
        b -= (faa * g - fab * f) / det
    return a, b
