"""ROS adapter of the tracker: frames and encoder in, measured markers out."""

import threading
import traceback
from contextlib import ExitStack
from typing import Any

from marker_tracker_node.arrays import ByteArray
from marker_tracker_node.ros.camera_port import Camera, CameraError, CameraPort
from marker_tracker_node.ros.message_handler import TrackerHandler
from marker_tracker_node.ros.parameters import TrackerParameters
from marker_tracker_node.tracking.tracker import Tracker
from marker_tracker_node.warm_up import warm_up
from winding_core.status import Level, Status
from winding_ros import graph, topics
from winding_ros.runtime.managed_node import ManagedNode


class MarkerTrackerNode(ManagedNode[TrackerParameters]):
    """Measures (r, theta, z) of every marker in every frame.

    Subscribes to camera/image_raw, camera/camera_info and rig/joint_states. Publishes
    tracker/markers, one message per frame with the frame's stamp, and tracker/lay.
    """

    def __init__(self, spec: graph.NodeSpec = graph.TRACKER, **kwargs: Any) -> None:
        super().__init__(spec, TrackerParameters, **kwargs)
        self._handler: TrackerHandler | None = None
        self._busy = threading.Lock()

    @property
    def tracker(self) -> Tracker | None:
        """The tracker of this run; None before the first calibration."""
        return self._handler.tracker if self._handler is not None else None

    def configure(self) -> None:
        """Read the machine's description; subscribe."""
        self._handler = TrackerHandler(self.configuration)
        # The first frame compiles the kernels: before time runs, not within it.
        warm_up(self._handler.config, lay=self.configuration.measure_lay)
        self.endpoints.connect(self._handler, busy=self._busy)

    def activate(self) -> None:
        """Begin a new run."""
        assert self._handler is not None
        self.publish(self._handler.begin(self.get_clock().now().nanoseconds * 1e-9))

    def status(self) -> Status:
        """Return the tracker's own status."""
        handler = self._handler
        report = None if handler is None else handler.report()
        if handler is None or handler.clock is None or report is None:
            return Status(name=topics.TRACKER, message="no calibrated camera_info yet")
        clock = handler.clock
        against = [
            *([report.clock_doubt] if report.clock_doubt else []),
            *([handler.pixels.remark] if handler.pixels.remark else []),
            *report.remarks,
            *([report.colour_refusal] if report.colour_refusal else []),
            *(item.sentence for item in report.contradictions),
            *report.doubts,
            *(f"{count} x {fault.value}" for fault, count in report.rejected.items() if count),
        ]
        return Status(
            name=topics.TRACKER,
            level=Level.ERROR if clock.refusal else Level.WARN if against else Level.OK,
            message="; ".join(against) or "tracking",
            values={
                "frames": str(report.frames),
                "known": str(report.known),
                "measured": str(report.measured),
                "encoder_losses": str(report.encoder_losses),
                "encoder_wraps": str(report.encoder_wraps + handler.lost_turns),
                "colour_separation": f"{report.colour_separation:.4f}",
                **clock.values(),
            },
        )

    def take_frame(self, t: float, frame: ByteArray) -> None:
        """Take a frame of time t [s] from a camera in this process, from any thread."""
        handler, trace = self._handler, self.endpoints.trace
        assert handler is not None
        # The encoder sample of the frame may be there already.
        self.endpoints.look()
        began = trace.taking()
        with self._busy:
            self.publish(handler.take_frame(t, frame))
        trace.handed_over(topics.IMAGE, t, began)

    def take_calibration(self, info: bytes) -> None:
        """Take the calibration of frames that come from this process, as CDR of a CameraInfo.

        Raises:
            MessageError: It is none.
        """
        handler = self._handler
        assert handler is not None
        with self._busy:
            self.publish(handler.take(topics.CAMERA_INFO, info))


class ComposedTrackerNode(MarkerTrackerNode):
    """The tracker with a camera in its process, which hands its frames over.

    Publishes camera/camera_info with every frame, camera/image_raw and its preview at 25 Hz, and
    tracker/markers for every frame, and tracker/lay. Subscribes to rig/joint_states.
    """

    def __init__(self, camera: Camera, **kwargs: Any) -> None:
        super().__init__(graph.COMPOSED_TRACKER, **kwargs)
        self._camera = camera
        self._open = ExitStack()

    def activate(self) -> None:
        """Begin a new run, and open the camera.

        Raises:
            CameraError: It does not open.
        """
        super().activate()
        port = CameraPort(self)
        try:
            self._open.enter_context(self._camera(port))
        except Exception as error:
            # Whoever wrote the camera needs to know where.
            self.get_logger().error(traceback.format_exc())
            raise CameraError(f"the camera does not open: {_in_words(error)}") from error
        # Closed first: what the device still delivers while it closes is not tracked.
        self._open.callback(port.close)

    def deactivate(self) -> None:
        """Close the camera; one that fails to is left alone."""
        try:
            self._open.close()
        except Exception as error:  # noqa: BLE001 - of code that is not the graph's
            self.get_logger().error(f"{traceback.format_exc()}the camera: {_in_words(error)}")


def _in_words(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"
