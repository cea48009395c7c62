"""What an OpenCV user writes to follow the markers: colour range, opening, blobs, rays."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from floors.gates import Box
from winding_rig_node.camera.config import CameraCalibration

# OpenCV's hue is half of the angle; the yellow of the bands, as public colour trackers set it.
LOWEST, HIGHEST = (18, 110, 50), (35, 255, 255)
KERNEL = np.ones((3, 3), np.uint8)
LEAST_AREA = 4


class ClassicTracker:
    """Markers from blobs of a colour, each in the box where it is expected.

    The centroid of a blob is taken for a point on the outside of the cable, R + 2 r from the axis.

    Args:
        calibration: Of the camera, which looks along -x.
        position: Of the camera [m].
        cylinder_radius: R [m].
        cable_radius: r [m].
    """

    def __init__(
        self,
        calibration: CameraCalibration,
        position: tuple[float, float, float],
        cylinder_radius: float,
        cable_radius: float,
    ) -> None:
        self._k, self._d = calibration.k, calibration.d
        self._offset, self._binning = calibration.roi[:2], calibration.binning
        self._camera = position
        self._outside = cylinder_radius + 2.0 * cable_radius
        # Of P0 when it was last seen: its azimuth less the encoder's, and its z.
        self._start = (0.0, 0.0)

    def track(
        self, frame: NDArray[np.uint8], angle: float, boxes: list[Box]
    ) -> dict[int, tuple[float, float]]:
        """Return (theta [rad], z [m]) by marker, both counted from P0.

        Args:
            frame: Blue-green-red, shape (rows, columns, 3).
            angle: Of the encoder [rad].
            boxes: Where to look.
        """
        found, pixels = [], []
        for box in boxes:
            blob = _largest_blob(frame[box.top : box.bottom, box.left : box.right])
            if blob is not None:
                found.append(box)
                pixels.append((blob[0] + box.left, blob[1] + box.top))
        if not found:
            return {}
        places = {}
        full = (np.array(pixels) + 0.5) * self._binning - 0.5 + self._offset
        rays = cv2.undistortPoints(full[:, None], self._k, self._d)[:, 0]
        for box, (a, b) in zip(found, rays.tolist(), strict=True):
            azimuth, z = self._on_cable(a, b, box.azimuth)
            if box.marker == 0:
                self._start = (azimuth - angle, z)
            places[box.marker] = (azimuth, z)
        begin, level = self._start
        return {n: (angle + begin - azimuth, z - level) for n, (azimuth, z) in places.items()}

    def _on_cable(self, a: float, b: float, near: float) -> tuple[float, float]:
        """Return azimuth near another [rad] and z [m] where a ray (-1, b, a) meets the cable."""
        x, y, z = self._camera
        square, half = 1.0 + b * b, y * b - x
        room = half * half - square * (x * x + y * y - self._outside**2)
        depth = (-half - math.sqrt(max(room, 0.0))) / square
        azimuth = math.atan2(y + depth * b, x - depth)
        azimuth += 2.0 * math.pi * round((near - azimuth) / (2.0 * math.pi))
        return azimuth, z + depth * a


def _largest_blob(pixels: NDArray[np.uint8]) -> tuple[float, float] | None:
    """Return column and row of the centroid of the largest blob, None without one."""
    hsv = cv2.cvtColor(pixels, cv2.COLOR_BGR2HSV)
    mask = cv2.inRange(hsv, LOWEST, HIGHEST)
    mask = cv2.morphologyEx(mask, cv2.MORPH_OPEN, KERNEL)
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not contours:
        return None
    moments = cv2.moments(max(contours, key=cv2.contourArea))
    if moments["m00"] < LEAST_AREA:
        return None
    return moments["m10"] / moments["m00"], moments["m01"] / moments["m00"]
