"""The camera as the tracker knows it: what CameraInfo says, and where the camera stands."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from marker_tracker_node.camera.compiled import compiled

FloatArray = NDArray[np.float64]

PLUMB_BOB = "plumb_bob"
UNDISTORTION_STEPS = 30
UNDISTORTION_TOLERANCE = 1.0e-13


@dataclass(frozen=True, kw_only=True)
class CameraPose:
    """Where the camera stands in the lab frame.

    Nominally it stands at +x and looks along -x, image x along +z, image y along +y.

    Attributes:
        position: Of the projection centre [m].
        tilt: Rotation vector about the camera's own axes from the nominal orientation [rad].
    """

    position: tuple[float, float, float] = (0.4175, 0.0, 0.05)
    tilt: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if not np.isfinite([*self.position, *self.tilt]).all():
            raise ValueError(f"pose must be finite, got {self.position} and {self.tilt}")

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

    Attributes:
        width: Columns of the full sensor.
        height: Rows of the full sensor.
        k: Camera matrix, shape (3, 3).
        d: plumb_bob distortion k1, k2, p1, p2, k3, shape (5,); empty for none.
        roi: x_offset, y_offset, width, height; all zero for the whole sensor.
        binning: Raw pixels per image pixel; zero counts as one.
        distortion_model: "plumb_bob".
    """

    width: int
    height: int
    k: FloatArray
    d: FloatArray
    roi: tuple[int, int, int, int] = (0, 0, 0, 0)
    binning: int = 1
    distortion_model: str = PLUMB_BOB

    @classmethod
    def from_info(
        cls,
        *,
        width: int,
        height: int,
        k: ArrayLike,
        d: ArrayLike,
        roi: tuple[int, int, int, int] = (0, 0, 0, 0),
        binning: int = 1,
        distortion_model: str = PLUMB_BOB,
    ) -> PinholeCamera:
        """Build a camera from the fields of a CameraInfo.

        Raises:
            ValueError: The camera is not calibrated (K[0] = 0), or a field contradicts another.
        """
        matrix = np.array(k, dtype=float).reshape(3, 3)
        distortion = np.array(d, dtype=float).ravel()
        if distortion.size == 0:
            distortion = np.zeros(5)
        if roi[2] == 0 or roi[3] == 0:
            roi = (0, 0, width, height)
        return cls(
            width=width,
            height=height,
            k=matrix,
            d=distortion,
            roi=roi,
            binning=max(binning, 1),
            distortion_model=distortion_model,
        )

    def __post_init__(self) -> None:
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

    def numbers(self, pose: CameraPose) -> FloatArray:
        """Return pose and lens as one flat array for the kernels, shape (24,).

        Axes by rows (9), position (3), fx, fy, cx, cy, distortion (5), offsets (2), binning.
        """
        return np.concatenate(
            [
                pose.axes.ravel(),
                pose.position,
                [self.k[0, 0], self.k[1, 1], self.k[0, 2], self.k[1, 2]],
                self.d,
                [self.roi[0], self.roi[1], self.binning],
            ]
        )

    def undistort(self, pixels: FloatArray) -> FloatArray:
        """Return coordinates on the undistorted image plane of image pixels, shape (n, 2)."""
        view = self.numbers(CameraPose())
        return np.array([plane_of_pixel(view, u, v) for u, v in pixels]).reshape(-1, 2)

    def pixels_of(self, pose: CameraPose, points: FloatArray) -> FloatArray:
        """Return the image pixels of lab points [m], shape (n, 2)."""
        view = self.numbers(pose)
        return np.array(
            [pixel_of_plane(view, *plane_of_point(view, x, y, z)[:2]) for x, y, z in points]
        ).reshape(-1, 2)

    def _require_invertible(self) -> None:
        """Refuse a distortion that folds the image over itself within the region used."""
        view = self.numbers(CameraPose())
        rows, columns = self.shape
        for u in np.linspace(-0.5, columns - 0.5, 17):
            for v in np.linspace(-0.5, rows - 0.5, 9):
                a, b = plane_of_pixel(view, u, v)
                back = pixel_of_plane(view, a, b)
                if not (abs(back[0] - u) < 1.0e-6 and abs(back[1] - v) < 1.0e-6):
                    raise ValueError(
                        f"distortion {self.d.tolist()} cannot be inverted at pixel "
                        f"({u:.1f}, {v:.1f})"
                    )


@compiled
def plane_of_point(
    view: FloatArray, x: float, y: float, z: float
) -> tuple[float, float, float]:  # pragma: no cover
    """Return undistorted plane coordinates and depth [m] of a lab point."""
    dx, dy, dz = x - view[9], y - view[10], z - view[11]
    depth = view[6] * dx + view[7] * dy + view[8] * dz
    a = (view[0] * dx + view[1] * dy + view[2] * dz) / depth
    b = (view[3] * dx + view[4] * dy + view[5] * dz) / depth
    return a, b, depth


@compiled
def pixel_of_plane(view: FloatArray, a: float, b: float) -> tuple[float, float]:  # pragma: no cover
    """Return column and row [pixels] in the image of undistorted plane coordinates."""
    k1, k2, p1, p2, k3 = view[16], view[17], view[18], view[19], view[20]
    q = a * a + b * b
    radial = 1.0 + k1 * q + k2 * q * q + k3 * q * q * q
    u = a * radial + 2.0 * p1 * a * b + p2 * (q + 2.0 * a * a)
    v = b * radial + p1 * (q + 2.0 * b * b) + 2.0 * p2 * a * b
    column = (view[12] * u + view[14] - view[21] + 0.5) / view[23] - 0.5
    row = (view[13] * v + view[15] - view[22] + 0.5) / view[23] - 0.5
    return column, row


@compiled
def plane_of_pixel(
    view: FloatArray, column: float, row: float
) -> tuple[float, float]:  # pragma: no cover
    """Return undistorted plane coordinates of an image pixel, by Newton's method.

    Five fixed-point steps, the habit of the trade, leave 0.4 px at k1 = -0.35.
    """
    k1, k2, p1, p2, k3 = view[16], view[17], view[18], view[19], view[20]
    u = (view[21] + view[23] * (column + 0.5) - 0.5 - view[14]) / view[12]
    v = (view[22] + view[23] * (row + 0.5) - 0.5 - view[15]) / view[13]
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
