"""Where a camera in the tracker's process hands its frames over, instead of publishing them.

A camera is a context manager that has the device open while the tracker is active; docs/vision.md
shows one. `python -m marker_tracker_node --camera my_camera:open_camera --ros-args ...` runs it, or
`winding run --machine external --compose my_camera:open_camera`.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any, Protocol

import cv2
import numpy as np
from rclpy.context import Context
from sensor_msgs.msg import CameraInfo

from marker_tracker_node.arrays import ByteArray
from winding_ros import topics
from winding_ros.messages.camera import encode_image, encode_preview
from winding_ros.messages.cdr import serialised
from winding_ros.messages.stamps import STAMP, stamp_parts, with_stamp
from winding_ros.runtime.endpoints import Endpoints

# Time between two of the frames that are published as well, for recorder and operator [s]; stamps
# are seconds in binary.
_SHOWN_PERIOD = 0.04 - 1.0e-6
_JPEG_QUALITY = 80

Camera = Callable[["CameraPort"], AbstractContextManager[Any]]


class CameraError(ValueError):
    """A camera cannot be used."""


class FrameTracker(Protocol):
    """The node that tracks what the port takes."""

    context: Context
    endpoints: Endpoints
    active: bool

    def take_calibration(self, info: bytes) -> None:
        """Take a CameraInfo in CDR bytes."""

    def take_frame(self, t: float, frame: ByteArray) -> None:
        """Take a frame, shape (rows, columns, 3), of time t [s]."""

    def fail(self, error: Exception) -> None:
        """End the process with an error."""


class CameraPort:
    """What a camera in the tracker's process hands its frames to, from any one thread."""

    def __init__(self, node: FrameTracker) -> None:
        self._node = node
        self._info = b""
        self._next = -np.inf
        self._closed = False
        self.context = node.context  # Of rclpy, for nodes of the camera's own
        self.fail = node.fail

    def close(self) -> None:
        """Take nothing any more: a device may deliver a frame that was on its way."""
        self._closed = True

    def calibrate(self, info: CameraInfo | bytes) -> None:
        """Take the calibration of the frames that follow: full resolution, window, binning.

        Raises:
            MessageError: No camera can have it.
        """
        data = serialised(info)
        self._node.take_calibration(data)
        self._info = data

    def take(self, t: float, frame: ByteArray) -> None:
        """Track a frame, and publish what the graph is to know of it.

        A frame whose time runs backwards is refused, counted and named in /diagnostics.

        Args:
            t: Instant of its exposure, on the clock of the joint states [s].
            frame: Blue-green-red, shape (rows, columns, 3); left unchanged until this returns.

        Raises:
            RuntimeError: No calibration has come before it.
            ValueError: The frame is no such array, or its time is no number.
        """
        if not self._info:
            raise RuntimeError("a frame has come before any calibration")
        if frame.dtype != np.uint8 or frame.ndim != 3 or frame.shape[2] != 3:
            raise ValueError(f"frame must be uint8 (h, w, 3), got {frame.dtype} {frame.shape}")
        if not np.isfinite(t):
            raise ValueError(f"the time of a frame must be finite, got {t} s")
        if self._closed or not self._node.active:
            return
        self._node.endpoints.admit(topics.IMAGE, t, lambda: self._track(t, frame))

    def _track(self, t: float, frame: ByteArray) -> None:
        info = with_stamp(self._info, STAMP.pack(*stamp_parts(t)))
        self._node.endpoints.publish(topics.CAMERA_INFO, info)
        self._node.take_frame(t, frame)
        if t >= self._next:
            self._next = t + _SHOWN_PERIOD
            self._show(t, frame)

    def exposed(self, t: float, began_ns: int) -> None:
        """Note when the pixels of time t [s] were there, by `time.time_ns`, for a run's trace."""
        self._node.endpoints.trace.exposed(t, began_ns)

    def _show(self, t: float, frame: ByteArray) -> None:
        endpoints = self._node.endpoints
        endpoints.publish(topics.IMAGE, encode_image(t, frame))
        _, jpeg = cv2.imencode(".jpg", frame, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
        endpoints.publish(topics.PREVIEW, encode_preview(t, jpeg.tobytes()))
