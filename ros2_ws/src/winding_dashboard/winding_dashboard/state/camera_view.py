"""Where lab points appear in the camera's picture: a plumb_bob camera with a known pose."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from winding_core.machine.readings import ImageWindow

FloatArray = NDArray[np.float64]

# Rows: image right, image down, line of sight, in the lab frame; the camera looks along -x.
_NOMINAL = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])


@dataclass(frozen=True, kw_only=True)
class CameraView:
    """A calibrated camera at a known place."""

    matrix: FloatArray  # Full-resolution K, shape (3, 3) [px]
    distortion: FloatArray  # plumb_bob k1, k2, p1, p2, k3, shape (5,)
    window: ImageWindow  # Part of the sensor that pictures show, with its binning
    width: int  # Full-resolution width [px]
    height: int  # Full-resolution height [px]
    position: FloatArray  # Of the camera in `winder_axis`, shape (3,) [m]
    # Rotation vector from the nominal orientation about the camera's axes, shape (3,) [rad].
    tilt: FloatArray

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of a picture [px]."""
        window = self.window
        return (
            (window.width or self.width) // window.binning,
            (window.height or self.height) // window.binning,
        )

    def pixels(self, points: FloatArray) -> FloatArray:
        """Return columns and rows of lab points in the picture.

        Args:
            points: Shape (n, 3) [m]; all in front of the camera.

        Returns:
            Shape (n, 2) [px of the picture]; pixel centres are whole numbers.
        """
        seen = (np.asarray(points, dtype=float) - self.position) @ self._axes().T
        a, b = seen[:, 0] / seen[:, 2], seen[:, 1] / seen[:, 2]
        k1, k2, p1, p2, k3 = self.distortion
        q = a * a + b * b
        radial = 1.0 + q * (k1 + q * (k2 + q * k3))
        u = a * radial + 2.0 * p1 * a * b + p2 * (q + 2.0 * a * a)
        v = b * radial + p1 * (q + 2.0 * b * b) + 2.0 * p2 * a * b
        column = self.matrix[0, 0] * u + self.matrix[0, 2] - self.window.x_offset
        row = self.matrix[1, 1] * v + self.matrix[1, 2] - self.window.y_offset
        # REP-104: a binned pixel is the mean of its raw ones.
        binning = self.window.binning
        return np.stack([(column + 0.5) / binning - 0.5, (row + 0.5) / binning - 0.5], axis=1)

    def _axes(self) -> FloatArray:
        angle = float(np.linalg.norm(self.tilt))
        if angle == 0.0:
            return _NOMINAL
        x, y, z = self.tilt / angle
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        turn = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)
        return np.asarray(turn.T @ _NOMINAL)
