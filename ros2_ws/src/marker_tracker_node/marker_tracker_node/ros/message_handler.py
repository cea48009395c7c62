"""Frames, calibration and encoder in, measured markers out."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from sensor_msgs.msg import CameraInfo

from marker_tracker_node.arrays import ByteArray, FloatArray
from marker_tracker_node.camera.image_formats import PixelReader
from marker_tracker_node.camera.pinhole import PinholeCamera
from marker_tracker_node.lay.lay_follower import LayFollower
from marker_tracker_node.ros.parameters import TrackerParameters
from marker_tracker_node.tracking.camera_clock import CameraClock, ClockSettings
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.report import TrackerReport
from marker_tracker_node.tracking.synchronised_tracker import SynchronisedTracker
from marker_tracker_node.tracking.tracker import Tracker
from winding_core.run_inputs import RunInputs
from winding_ros import topics
from winding_ros.messages.camera import (
    CameraReading,
    decode_camera_info,
    decode_compressed,
    decode_image,
)
from winding_ros.messages.clouds import encode_cloud
from winding_ros.messages.rig import JointStateReader
from winding_ros.messages.serialised import MessageError, deserialised
from winding_ros.messages.stamps import stamp_bytes, stampless, with_stamp
from winding_ros.runtime.message_handler import Answer
from winding_ros.topic import Topic

# Topics overtake each other: the first calibration may come a few frames late.
_FRAMES_BEFORE_CALIBRATION = 50
# Older turns have been published before.
_TURNS_PUBLISHED = 12
_LAY_PERIOD = 1.0 / (topics.TRACKED_LAY.rate or 10.0)


class TrackerHandler:
    """Measures the markers of every frame, once the encoder has come as far as the frame.

    Attributes:
        config: Machine, cable and camera pose.
        pixels: Reads the frames.
    """

    def __init__(self, wanted: TrackerParameters) -> None:
        self.config = TrackerConfig.of(wanted.resolved(), wanted, wanted, row_time=wanted.row_time)
        self._wanted = wanted
        self._replay = Path(wanted.replay) if wanted.replay else None
        self._motion_before: FloatArray | None = None
        self._begin()

    @property
    def tracker(self) -> Tracker | None:
        """The tracker of this run; None before the first calibration."""
        return self._live.tracker

    @property
    def clock(self) -> CameraClock | None:
        """The camera's clock in this run; None before the first calibration."""
        return self._live.clock

    def report(self) -> TrackerReport | None:
        """Return what is reported of this run; None before the first calibration."""
        return self._live.report()

    @property
    def lost_turns(self) -> int:
        """Turns that the encoder lost by wrapping."""
        return self._live.history.lost_turns

    def begin(self, t: float) -> Iterator[Answer]:
        """Begin a new run, or take one up; nothing is published before the first frame."""
        self._motion_before = None
        if self._replay is not None:
            self._motion_before = _motion(RunInputs.read(self._replay))
            # The run after this one begins with its own start.
            self._replay = None
        self._begin()
        yield from ()

    def _begin(self) -> None:
        wanted = self._wanted
        self._read = JointStateReader(wanted)
        self._camera: CameraReading | None = None
        self._calibration = b""
        self._uncalibrated = 0
        self.pixels = PixelReader(wanted.encoding, wanted.significant_bits)
        # A float of seconds since 1970 holds no nanoseconds: answers bear the frame's own stamp.
        self._stamps: dict[float, bytes] = {}
        self._follower = LayFollower() if wanted.measure_lay else None
        self._lay_due = -math.inf
        self._live = SynchronisedTracker(
            ClockSettings(correct=wanted.camera_clock_correction, limit=wanted.camera_clock_limit),
            beside=self._follower.take if self._follower is not None else None,
        )

    def take(self, topic: Topic, data: bytes) -> Iterator[Answer]:
        """Take a calibration, an encoder sample or a frame; yield the frames that can be measured.

        Raises:
            MessageError: The message cannot be used.
        """
        if topic is topics.CAMERA_INFO:
            self._calibrate(data)
            yield from self._measure()
        elif topic is topics.JOINT_STATES:
            t, reading = self._read(data)
            self._live.add_reading(t, reading)
            yield from self._measure()
        else:
            decode = decode_compressed if topic is topics.PREVIEW else decode_image
            t, frame = decode(data, self.pixels)
            if self.tracker is None:
                self._uncalibrated += 1
                if self._uncalibrated > _FRAMES_BEFORE_CALIBRATION:
                    raise MessageError("no calibrated camera_info has come before this frame")
            self._stamps[t] = stamp_bytes(data)
            yield from self.take_frame(t, frame)

    def take_frame(self, t: float, frame: ByteArray) -> Iterator[Answer]:
        """Take a frame of time t [s], shape (height, width, 3)."""
        self._live.add_frame(t, frame)
        yield from self._measure()

    def _calibrate(self, data: bytes) -> None:
        # Nearly every calibration is the last one with another stamp.
        if stampless(data) == self._calibration:
            return
        try:
            _, reading = decode_camera_info(deserialised(data, CameraInfo))
            if self._camera is None or not _same(reading, self._camera):
                tracker = Tracker(self.config, _camera(reading), motion_before=self._motion_before)
                self._live.start(tracker)
                self._camera = reading
            self._calibration = stampless(data)
        except MessageError:
            # A camera that has no calibration gets none by waiting.
            self._uncalibrated = _FRAMES_BEFORE_CALIBRATION
            raise

    def _measure(self) -> Iterator[Answer]:
        for t, markers in self._live.measured():
            cloud = encode_cloud(t, markers)
            stamp = self._stamps.pop(t, None)
            if stamp is not None:
                cloud = with_stamp(cloud, stamp)
            yield Answer(topic=topics.TRACKED_MARKERS, message=cloud, shown=self._shown(t))
            yield from self._lay(t, stamp)

    def _shown(self, t: float) -> tuple[float, float] | None:
        """Return the stamp of a frame and its instant on the encoder's clock, once corrected."""
        clock = self.clock
        return (t, t - clock.estimate.offset) if clock is not None and clock.applied else None

    def _lay(self, t: float, stamp: bytes | None) -> Iterator[Answer]:
        """Yield the lay when it is due, with the stamp of its last frame."""
        follower = self._follower
        if follower is None or follower.lay is None or 0.0 <= self._lay_due - t <= _LAY_PERIOD:
            return
        self._lay_due = t + _LAY_PERIOD
        cloud = encode_cloud(t, follower.lay.records(_TURNS_PUBLISHED))
        yield Answer(
            topic=topics.TRACKED_LAY, message=cloud if stamp is None else with_stamp(cloud, stamp)
        )


def _motion(inputs: RunInputs) -> FloatArray:
    """Return times [s], cylinder angles [rad] and guide positions [m], shape (3, n)."""
    samples = inputs.samples
    return np.stack([samples[name] for name in ("t", "cylinder_angle", "carriage_position")])


def _camera(reading: CameraReading) -> PinholeCamera:
    window = reading.window
    try:
        return PinholeCamera(
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
