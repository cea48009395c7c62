"""ROS adapter of the tracker: frames and encoder in, measured markers out."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, Image, JointState

from cable_winding.ros import topics
from cable_winding.ros.camera_messages import CameraReading, decode_camera_info, decode_image
from cable_winding.ros.cloud_messages import encode_cloud
from cable_winding.ros.diagnostic_messages import Level, Status
from cable_winding.ros.managed_node import ManagedNode
from cable_winding.ros.rig_messages import MessageError, decode_joint_state
from marker_tracker_node.config import TrackerConfig
from marker_tracker_node.parameters import TrackerParameters
from marker_tracker_node.pinhole import CameraPose, PinholeCamera
from marker_tracker_node.synchroniser import Synchroniser
from marker_tracker_node.tracker import Tracker
from marker_tracker_node.warm_up import warm_up


class MarkerTrackerNode(ManagedNode[TrackerParameters]):
    """Measures (r, theta, z) of every marker in every frame.

    Subscribes to camera/image_raw, camera/camera_info and rig/joint_states. Publishes
    tracker/markers, one message per frame with the frame's stamp.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(topics.TRACKER, TrackerParameters, **kwargs)
        self._tracker: Tracker | None = None
        self._busy = threading.Lock()

    def configure(self) -> None:
        """Read the machine's description; advertise and subscribe."""
        wanted = self.configuration
        case, drive = wanted.condition(), wanted.drive()
        self._config = TrackerConfig(
            cylinder_radius=case.cylinder_radius,
            cable_radius=case.cable_radius,
            marker_spacing=case.marker_spacing,
            marker_count=case.marker_count,
            expected_stretch=1.0 + case.nominal_stress / case.material.young,
            band_width=wanted.band_width,
            pose=CameraPose(
                position=_triple(wanted.camera_position), tilt=_triple(wanted.camera_tilt)
            ),
            advance_per_radian=drive.advance_per_radian,
            free_length=wanted.free_length,
            angular_speed=drive.angular_speed,
        )
        # The first frame compiles the kernels: before time runs, not within it.
        warm_up(self._config)
        self._markers_out = self.advertise(topics.TRACKED_MARKERS)
        self.subscribe(topics.CAMERA_INFO, self._on_camera_info)
        self.subscribe(topics.JOINT_STATES, self._on_joint_state)
        self.subscribe(topics.IMAGE, self._on_image)

    def activate(self) -> None:
        """Begin a new run."""
        self._tracker = None
        self._camera: CameraReading | None = None
        self._synchroniser = Synchroniser()

    def status(self) -> Status:
        """Return what the tracker says of itself."""
        if self._tracker is None:
            return Status(name=topics.TRACKER, message="no calibrated camera_info yet")
        report = self._tracker.report()
        against = [
            *([report.colour_refusal] if report.colour_refusal else []),
            *(["the encoder is silent"] if report.encoder_lost else []),
            *(f"P{marker} has slipped" for marker in report.slipped),
            *(f"{count} x {fault.value}" for fault, count in report.rejected.items() if count),
        ]
        return Status(
            name=topics.TRACKER,
            level=Level.WARN if against else Level.OK,
            message="; ".join(against) or "tracking",
            values={
                "frames": str(report.frames),
                "known": str(report.known),
                "measured": str(report.measured),
                "encoder_losses": str(report.encoder_losses),
                "encoder_wraps": str(report.encoder_wraps),
                "colour_separation": f"{report.colour_separation:.4f}",
            },
        )

    def _on_camera_info(self, message: CameraInfo) -> None:
        _, reading = decode_camera_info(message)
        if self._camera is None or not _same(reading, self._camera):
            self._tracker = Tracker(self._config, _camera(reading))
            self._camera = reading

    def _on_joint_state(self, message: JointState) -> None:
        t, reading = decode_joint_state(message)
        with self._busy:
            self._synchroniser.add_reading(t, reading)
            self._track()

    def _on_image(self, message: Image) -> None:
        t, frame = decode_image(message)
        if self._tracker is None:
            raise MessageError("no calibrated camera_info has come before this frame")
        self.take_frame(t, frame)

    def take_frame(self, t: float, frame: NDArray[np.uint8]) -> None:
        """Take a frame of time t [s] from a camera in this process, from any thread."""
        with self._busy:
            self._synchroniser.add_frame(t, frame)
            self._track()

    def _track(self) -> None:
        if self._tracker is None:
            return
        for pair in self._synchroniser.ready():
            markers = self._tracker.track(pair.frame, pair.t, pair.cylinder_angle, pair.guide_z)
            self._markers_out.publish(encode_cloud(pair.t, markers))


def _camera(reading: CameraReading) -> PinholeCamera:
    window = reading.window
    try:
        return PinholeCamera.from_info(
            width=reading.width,
            height=reading.height,
            k=reading.matrix,
            d=reading.distortion,
            roi=(window.x_offset, window.y_offset, window.width, window.height),
            binning=window.binning,
        )
    except ValueError as error:
        raise MessageError(str(error)) from error


def _same(one: CameraReading, other: CameraReading) -> bool:
    return (
        (one.width, one.height, one.window) == (other.width, other.height, other.window)
        and bool((one.matrix == other.matrix).all())
        and bool((one.distortion == other.distortion).all())
    )


def _triple(values: list[float]) -> tuple[float, float, float]:
    x, y, z = values
    return x, y, z
