"""The tracker's node: one answer per frame, refusals in diagnostics."""

from typing import Any

import numpy as np
import pytest
from marker_film import DRIVE, Film, axes
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from sensor_msgs.msg import CameraInfo

from marker_tracker_node.node import MarkerTrackerNode
from marker_tracker_node.ros.message_handler import TrackerHandler
from marker_tracker_node.ros.parameters import TrackerParameters
from winding_core.cable.cases import paper_case
from winding_core.lay.records import LAY_DTYPE
from winding_core.machine.readings import ImageWindow
from winding_core.markers import MARKER_DTYPE, MarkerFlag
from winding_core.status import Level
from winding_rig_node.camera import CameraConfig
from winding_rig_node.lay.known_lay import CableLay
from winding_ros import topics
from winding_ros.messages.camera import CameraReading, encode_camera_info, encode_image
from winding_ros.messages.cdr import serialised
from winding_ros.messages.clouds import decode_cloud
from winding_ros.messages.rig import encode_joint_state

FRAMES = 40
PERIOD = 0.005


class Bench:
    """An active tracker that is shown rendered frames of case 4."""

    def __init__(self, ros: Any) -> None:
        self.ros = ros
        self.node = ros.add(MarkerTrackerNode, parameter_overrides=[Parameter("case", value=4)])
        probe = ros.plain()
        self.markers: list[Any] = []
        topics.TRACKED_MARKERS.subscribe(probe, self.markers.append)
        self.image = topics.IMAGE.advertise(probe)
        self.info = topics.CAMERA_INFO.advertise(probe)
        self.joints = topics.JOINT_STATES.advertise(probe)
        assert self.node.trigger_configure() is TransitionCallbackReturn.SUCCESS
        assert self.node.trigger_activate() is TransitionCallbackReturn.SUCCESS
        publishers = (self.image, self.info, self.joints)
        ros.spin_until(lambda: all(p.get_subscription_count() == 1 for p in publishers))
        ros.spin_until(lambda: self.node.matched("tracker/markers") == 1)
        self.camera = CameraConfig()
        path = {"path_theta": np.linspace(0.0, 2.0, 50), "path_z": np.linspace(0.0, 1e-3, 50)}
        lay = CableLay(**path, marker_theta=np.array([0.0, 6.28]))
        self._film = Film(case=paper_case(4), lay=lay, seed=0)

    def calibration(self) -> CameraReading:
        content = self.camera.calibration()
        x, y, width, height = content.roi
        return CameraReading(
            width=content.width,
            height=content.height,
            matrix=content.k,
            distortion=content.d,
            window=ImageWindow(
                x_offset=x, y_offset=y, width=width, height=height, binning=content.binning
            ),
        )

    def frame(self, t: float) -> np.ndarray:
        return self._film.frame_at(*DRIVE.positions(t))

    def encoder(self, t: float) -> None:
        self.joints.publish(encode_joint_state(t, axes(*DRIVE.positions(t))))

    def calibrate(self) -> None:
        self.info.publish(encode_camera_info(0.0, self.calibration()))
        self.ros.spin_until(lambda: self.node.tracker is not None)


@pytest.fixture
def bench(ros: Any) -> Bench:
    return Bench(ros)


def test_every_frame_is_answered_with_its_stamp(bench):
    bench.calibrate()
    for index in range(FRAMES):
        bench.encoder(index * PERIOD)
        bench.image.publish(encode_image(index * PERIOD, bench.frame(index * PERIOD)))
    bench.ros.spin_until(lambda: len(bench.markers) == FRAMES)
    stamps = [decode_cloud(message, MARKER_DTYPE)[0] for message in bench.markers]
    np.testing.assert_allclose(stamps, PERIOD * np.arange(FRAMES), atol=1e-9)
    _, markers = decode_cloud(bench.markers[-1], MARKER_DTYPE)
    assert markers["flags"][0] == 0
    assert (markers["flags"][1:] & MarkerFlag.NOT_WOUND).all()


def test_frames_wait_for_their_encoder_sample(bench):
    bench.calibrate()
    for index in range(5):
        bench.image.publish(encode_image(index * PERIOD, bench.frame(index * PERIOD)))
    bench.encoder(0.0)
    bench.ros.spin_until(lambda: len(bench.markers) == 1)
    bench.encoder(4 * PERIOD)
    bench.ros.spin_until(lambda: len(bench.markers) == 5)


def test_frame_without_calibration_is_refused_and_reported(bench):
    bench.info.publish(CameraInfo())
    bench.ros.spin_until(lambda: bench.node.endpoints._guards["camera/camera_info"].refused == 1)
    bench.image.publish(encode_image(0.0, bench.frame(0.0)))
    bench.ros.spin_until(lambda: bench.node.endpoints._guards["camera/image_raw"].refused == 1)
    assert bench.markers == []
    assert bench.node.status().message == "no calibrated camera_info yet"


def test_frames_that_overtake_the_first_calibration_are_measured(bench):
    for index in range(4):
        bench.encoder(index * PERIOD)
        bench.image.publish(encode_image(index * PERIOD, bench.frame(index * PERIOD)))
    image = bench.node.endpoints._guards["camera/image_raw"]
    bench.ros.spin_until(lambda: image.accepted == 4)
    bench.calibrate()
    bench.ros.spin_until(lambda: len(bench.markers) == 4)


def test_silent_encoder_is_reported_and_frames_still_answered(bench):
    bench.calibrate()
    for index in range(FRAMES):
        bench.image.publish(encode_image(index * PERIOD, bench.frame(index * PERIOD)))
    # Frames older than the synchroniser's patience of 0.1 s go without the encoder.
    bench.ros.spin_until(lambda: len(bench.markers) >= FRAMES - 21)
    assert "the encoder is silent" in bench.node.status().message


def test_frame_of_another_size_gets_an_empty_answer(bench):
    bench.calibrate()
    bench.encoder(0.0)
    bench.image.publish(encode_image(0.0, np.zeros((48, 64, 3), dtype=np.uint8)))
    bench.ros.spin_until(lambda: len(bench.markers) == 1)
    assert len(decode_cloud(bench.markers[0], MARKER_DTYPE)[1]) == 0
    assert "frame of another size" in bench.node.status().message


def test_a_camera_of_another_hour_is_an_error_in_one_sentence(bench):
    bench.calibrate()
    bench.image.publish(encode_image(3600.0, bench.frame(0.0)))
    image = bench.node.endpoints._guards["camera/image_raw"]
    bench.ros.spin_until(lambda: image.accepted == 1)
    for index in range(4):
        bench.encoder(index * PERIOD)
    bench.ros.spin_until(lambda: len(bench.markers) == 1)
    status = bench.node.status()
    assert status.level is Level.ERROR
    assert "ms ahead of the encoder's, limit camera_clock_limit 250 ms" in status.message
    assert status.values["camera_clock_offset_ms"] == "nan"
    assert len(decode_cloud(bench.markers[0], MARKER_DTYPE)[1]) == 0
    assert bench.markers[0].header.stamp.sec == 3600


def test_the_lay_is_published_when_it_is_asked_for(bench):
    handler = TrackerHandler(TrackerParameters(case=4, measure_lay=True))
    info = serialised(encode_camera_info(0.0, bench.calibration()))
    answers = list(handler.take(topics.CAMERA_INFO, info))
    for index in range(3):
        t = index * 0.5
        reading = axes(*DRIVE.positions(t))
        answers += handler.take(topics.JOINT_STATES, serialised(encode_joint_state(t, reading)))
        answers += handler.take(topics.IMAGE, serialised(encode_image(t, bench.frame(t))))
    lays = [answer for answer in answers if answer.topic is topics.TRACKED_LAY]
    assert len(lays) == 3
    _, records = decode_cloud(lays[-1].data, LAY_DTYPE)
    # The turn that has just begun lies within a millimetre of P0.
    assert len(records)
    assert (np.abs(records["z"]) < 1e-3).all()
