"""A camera and the tracker in one process: frames are handed over instead of published.

A camera is a function that opens it, for as long as the tracker is active:

    @contextmanager
    def open_camera(port: CameraPort) -> Iterator[None]:
        device = my_sdk.open()
        port.calibrate(info)                      # sensor_msgs/CameraInfo
        device.on_frame(lambda frame: port.take(frame.time, frame.pixels))

Yield:
        device.close()

    python -m marker_tracker_node.composition my_camera:open_camera --ros-args ...

or, in a run, `winding run --machine external --compose my_camera:open_camera`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo

from marker_tracker_node.node import MarkerTrackerNode
from winding_core.camera_source import CameraSource, CameraSourceError
from winding_ros import graph, topics
from winding_ros.camera_messages import encode_image, encode_preview
from winding_ros.process import EXIT_REFUSED, run_node
from winding_ros.stamps import STAMP, stamp_parts, with_stamp
from winding_ros.wire.cdr import serialised

# Time between two of the frames that are published as well, for recorder and operator [s]; stamps
# are seconds in binary.
_SHOWN_PERIOD = 0.04 - 1.0e-6
_JPEG_QUALITY = 80

Camera = Callable[["CameraPort"], AbstractContextManager[Any]]


class CameraPort:
    """What a camera in the tracker's process hands its frames to, from any one thread.

    Attributes:
        context: Of rclpy, for nodes of the camera's own.
    """

    def __init__(self, node: ComposedTracker) -> None:
        self._node = node
        self._info = b""
        self._next = -np.inf
        self.context = node.context
        self.fail = node.fail

    def calibrate(self, info: CameraInfo | bytes) -> None:
        """Take the calibration of the frames that follow: full resolution, window, binning.

        Raises:
            MessageError: No camera can have it.
        """
        data = serialised(info)
        self._node.take_calibration(data)
        self._info = data

    def take(self, t: float, frame: NDArray[np.uint8]) -> None:
        """Track a frame, and publish what the graph is to know of it.

        Args:
            t: Instant of its exposure, on the clock of the joint states [s].
            frame: Blue-green-red, shape (rows, columns, 3); left unchanged until this returns.

        Raises:
            RuntimeError: No calibration has come before it.
        """
        if not self._info:
            raise RuntimeError("a frame has come before any calibration")
        if not self._node.active:
            return
        info = with_stamp(self._info, STAMP.pack(*stamp_parts(t)))
        self._node.endpoints.publish(topics.CAMERA_INFO, info)
        self._node.take_frame(t, frame)
        if t >= self._next:
            self._next = t + _SHOWN_PERIOD
            self._show(t, frame)

    def exposed(self, t: float, began_ns: int) -> None:
        """Note that the pixels of a frame are there, for `winding run --trace`.

        Args:
            t: Its instant [s].
            began_ns: When that was, by `time.time_ns`.
        """
        self._node.endpoints.trace.exposed(t, began_ns)

    def _show(self, t: float, frame: NDArray[np.uint8]) -> None:
        endpoints = self._node.endpoints
        endpoints.publish(topics.IMAGE, encode_image(t, frame))
        _, jpeg = cv2.imencode(".jpg", frame, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
        endpoints.publish(topics.PREVIEW, encode_preview(t, jpeg.tobytes()))


class ComposedTracker(MarkerTrackerNode):
    """The tracker with a camera in its process; publishes few of its frames.

    Publishes camera/camera_info with every frame, camera/image_raw and its preview at 25 Hz, and
    tracker/markers for every frame. Subscribes to rig/joint_states.

    Args:
        camera: Opens the camera while the node is active.
        kwargs: Of the node.
    """

    def __init__(self, camera: Camera, **kwargs: Any) -> None:
        super().__init__(graph.COMPOSED_TRACKER, **kwargs)
        self._camera = camera
        self._open = ExitStack()

    def activate(self) -> None:
        """Begin a new run, and open the camera."""
        super().activate()
        self._open.enter_context(self._camera(CameraPort(self)))

    def deactivate(self) -> None:
        """Close the camera."""
        self._open.close()


def main() -> int:
    """Entry point of the process: what opens the camera, then arguments for ROS."""
    if len(sys.argv) < 2:
        print("error: give a camera, MODULE:FUNCTION or FILE.py:FUNCTION", file=sys.stderr)
        return EXIT_REFUSED
    try:
        camera = CameraSource.parsed(sys.argv.pop(1)).load()
    except CameraSourceError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_REFUSED
    return run_node(lambda: ComposedTracker(camera))


if __name__ == "__main__":
    sys.exit(main())
