"""The tracker's nodes: one answer per frame, refusals in diagnostics, a camera in the process."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from marker_film import DRIVE, Film, axes
from rclpy.lifecycle import TransitionCallbackReturn
from sensor_msgs.msg import CameraInfo, RegionOfInterest

from marker_tracker_node.node import ComposedTrackerNode, MarkerTrackerNode
from marker_tracker_node.ros.message_handler import TrackerHandler
from marker_tracker_node.ros.parameters import TrackerParameters
from winding_core.cable.cases import paper_case
from winding_core.lay.records import LAY_DTYPE
from winding_core.markers import MARKER_DTYPE, MarkerFlag
from winding_core.status import Level
from winding_rig_node.camera import CameraConfig
from winding_rig_node.lay.known_lay import CableLay
from winding_rig_node.ros.camera import reading_of
from winding_ros import topics
from winding_ros.messages.camera import encode_camera_info, encode_image
from winding_ros.messages.cdr import serialised
from winding_ros.messages.clouds import decode_cloud
from winding_ros.messages.rig import encode_joint_state

FRAMES = 40
PERIOD = 0.005
FRAME = np.zeros((48, 64, 3), dtype=np.uint8)


class Bench:
    """An active tracker that is shown rendered frames of case 4."""

    def __init__(self, ros: Any) -> None:
        self.ros = ros
        self.node = ros.add(MarkerTrackerNode, parameters={"case": 4})
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

    def frame(self, t: float) -> np.ndarray:
        return self._film.frame_at(*DRIVE.positions(t))

    def encoder(self, t: float) -> None:
        self.joints.publish(encode_joint_state(t, axes(*DRIVE.positions(t))))

    def calibrate(self) -> None:
        self.info.publish(encode_camera_info(0.0, reading_of(self.camera.calibration())))
        self.ros.spin_until(lambda: self.node.tracker is not None)


@pytest.fixture
def bench(ros: Any) -> Bench:
    return Bench(ros)


def test_every_frame_is_answered_with_its_stamp(bench: Bench) -> None:
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


def test_frames_wait_for_their_encoder_sample(bench: Bench) -> None:
    bench.calibrate()
    for index in range(5):
        bench.image.publish(encode_image(index * PERIOD, bench.frame(index * PERIOD)))
    bench.encoder(0.0)
    bench.ros.spin_until(lambda: len(bench.markers) == 1)
    bench.encoder(4 * PERIOD)
    bench.ros.spin_until(lambda: len(bench.markers) == 5)


def test_frame_without_calibration_is_refused_and_reported(bench: Bench) -> None:
    bench.info.publish(CameraInfo())
    bench.ros.spin_until(lambda: bench.node.endpoints._guards["camera/camera_info"].refused == 1)
    bench.image.publish(encode_image(0.0, bench.frame(0.0)))
    bench.ros.spin_until(lambda: bench.node.endpoints._guards["camera/image_raw"].refused == 1)
    assert bench.markers == []
    assert bench.node.status().message == "no calibrated camera_info yet"


def test_frames_that_overtake_the_first_calibration_are_measured(bench: Bench) -> None:
    for index in range(4):
        bench.encoder(index * PERIOD)
        bench.image.publish(encode_image(index * PERIOD, bench.frame(index * PERIOD)))
    image = bench.node.endpoints._guards["camera/image_raw"]
    bench.ros.spin_until(lambda: image.accepted == 4)
    bench.calibrate()
    bench.ros.spin_until(lambda: len(bench.markers) == 4)


def test_silent_encoder_is_reported_and_frames_still_answered(bench: Bench) -> None:
    bench.calibrate()
    for index in range(2 * FRAMES):
        bench.image.publish(encode_image(index * PERIOD, bench.frame(index * PERIOD)))
    # Frames older than the synchroniser's patience of 0.2 s go without the encoder.
    bench.ros.spin_until(lambda: len(bench.markers) >= 2 * FRAMES - 41)
    assert "the encoder is silent" in bench.node.status().message


def test_frame_of_another_size_gets_an_empty_answer(bench: Bench) -> None:
    bench.calibrate()
    bench.encoder(0.0)
    bench.image.publish(encode_image(0.0, np.zeros((48, 64, 3), dtype=np.uint8)))
    bench.ros.spin_until(lambda: len(bench.markers) == 1)
    assert len(decode_cloud(bench.markers[0], MARKER_DTYPE)[1]) == 0
    assert "frame of another size" in bench.node.status().message


def test_a_camera_of_another_hour_is_an_error_in_one_sentence(bench: Bench) -> None:
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


def test_the_lay_is_published_when_it_is_asked_for(bench: Bench) -> None:
    handler = TrackerHandler(TrackerParameters(case=4, measure_lay=True))
    info = serialised(encode_camera_info(0.0, reading_of(bench.camera.calibration())))
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


def calibration() -> CameraInfo:
    info = CameraInfo(height=48, width=64, distortion_model="plumb_bob", d=[0.0] * 5)
    info.k = [900.0, 0.0, 32.0, 0.0, 900.0, 24.0, 0.0, 0.0, 1.0]
    info.roi = RegionOfInterest(width=64, height=48)
    return info


class Device:
    """A camera that may be broken."""

    def __init__(self) -> None:
        self.opens = self.closes = True
        self.opened = 0
        self.port: Any = None

    @contextmanager
    def open_camera(self, port: Any) -> Iterator[None]:
        if not self.opens:
            raise OSError("no such device")
        self.opened += 1
        self.port = port
        yield
        self.opened -= 1
        if not self.closes:
            raise OSError("the cable is out")


@pytest.fixture
def device() -> Device:
    return Device()


@pytest.fixture
def node(ros: Any, device: Device) -> ComposedTrackerNode:
    made = ros.add(ComposedTrackerNode, device.open_camera, parameters={"case": 4})
    assert made.trigger_configure() is TransitionCallbackReturn.SUCCESS
    tracker: ComposedTrackerNode = made
    return tracker


def test_camera_is_open_while_the_node_is_active(node: ComposedTrackerNode, device: Device) -> None:
    for _ in range(2):
        assert node.trigger_activate() is TransitionCallbackReturn.SUCCESS
        assert device.opened == 1
        assert node.trigger_deactivate() is TransitionCallbackReturn.SUCCESS
        assert device.opened == 0


def test_a_camera_may_be_refused_and_open_later(node: ComposedTrackerNode, device: Device) -> None:
    device.opens = False
    assert node.trigger_activate() is TransitionCallbackReturn.FAILURE
    (own, *_) = node._statuses()
    assert own.level is Level.ERROR
    assert own.message == "cannot activate: the camera does not open: OSError: no such device"
    device.opens = True
    assert node.trigger_activate() is TransitionCallbackReturn.SUCCESS


def test_a_camera_that_does_not_close_leaves_the_node_as_others_do(
    node: ComposedTrackerNode, device: Device
) -> None:
    device.closes = False
    assert node.trigger_activate() is TransitionCallbackReturn.SUCCESS
    assert node.trigger_deactivate() is TransitionCallbackReturn.SUCCESS
    assert not node.active


def stamps(ros: Any, node: ComposedTrackerNode) -> list[int]:
    """Return a list that fills with the stamps of the frames the graph receives [ns]."""
    found: list[int] = []
    listener = ros.plain("listener")
    topics.CAMERA_INFO.subscribe(listener, lambda info: found.append(info.header.stamp.nanosec))
    ros.spin_until(lambda: node.matched(topics.CAMERA_INFO.name) == 1)
    return found


def test_a_frame_whose_time_runs_backwards_is_refused_and_counted(
    ros: Any, node: ComposedTrackerNode, device: Device
) -> None:
    heard = stamps(ros, node)
    assert node.trigger_activate() is TransitionCallbackReturn.SUCCESS
    device.port.calibrate(calibration())
    for milliseconds in (10, 5, 15):
        device.port.take(1e-3 * milliseconds, FRAME)
    ros.spin_until(lambda: len(heard) == 2)
    assert heard == [10_000_000, 15_000_000]
    statuses = " ".join(f"{s.message} {s.values}" for s in node._statuses())
    assert "time went back from 0.010 to 0.005 s" in statuses


@pytest.mark.parametrize(
    ("t", "frame", "sentence"),
    [
        (0.0, FRAME[:, :, 0], r"frame must be uint8 \(h, w, 3\), got uint8 \(48, 64\)"),
        (0.0, FRAME.astype(float), "got float64"),
        (float("nan"), FRAME, "the time of a frame must be finite, got nan s"),
    ],
)
def test_what_is_no_frame_is_refused_where_it_is_handed_over(
    node: ComposedTrackerNode, device: Device, t: float, frame: Any, sentence: str
) -> None:
    assert node.trigger_activate() is TransitionCallbackReturn.SUCCESS
    with pytest.raises(RuntimeError, match="before any calibration"):
        device.port.take(0.0, FRAME)
    device.port.calibrate(calibration())
    with pytest.raises(ValueError, match=sentence):
        device.port.take(t, frame)


def test_a_late_frame_is_left_alone(ros: Any, node: ComposedTrackerNode, device: Device) -> None:
    heard = stamps(ros, node)
    assert node.trigger_activate() is TransitionCallbackReturn.SUCCESS
    late = device.port
    late.calibrate(calibration())
    assert node.trigger_deactivate() is TransitionCallbackReturn.SUCCESS
    assert node.trigger_activate() is TransitionCallbackReturn.SUCCESS
    late.take(0.01, FRAME)
    device.port.calibrate(calibration())
    device.port.take(0.02, FRAME)
    ros.spin_until(lambda: bool(heard))
    assert heard == [20_000_000]
