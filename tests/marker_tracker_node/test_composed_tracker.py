"""A camera in the tracker's process: opened with the node's activation, closed with its end."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from sensor_msgs.msg import CameraInfo, RegionOfInterest

from marker_tracker_node.node import ComposedTrackerNode
from winding_core.status import Level
from winding_ros import topics

FRAME = np.zeros((48, 64, 3), dtype=np.uint8)


def calibration() -> CameraInfo:
    """Return the calibration of FRAME."""
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
    made = ros.add(
        ComposedTrackerNode, device.open_camera, parameter_overrides=[Parameter("case", value=4)]
    )
    assert made.trigger_configure() is TransitionCallbackReturn.SUCCESS
    tracker: ComposedTrackerNode = made
    return tracker


def test_the_camera_is_open_while_the_node_is_active(node, device):
    for _ in range(2):
        assert node.trigger_activate() is TransitionCallbackReturn.SUCCESS
        assert device.opened == 1
        assert node.trigger_deactivate() is TransitionCallbackReturn.SUCCESS
        assert device.opened == 0


def test_a_camera_that_does_not_open_is_refused_and_may_open_later(node, device):
    device.opens = False
    assert node.trigger_activate() is TransitionCallbackReturn.FAILURE
    (own, *_) = node._statuses()
    assert own.level is Level.ERROR
    assert own.message == "cannot activate: the camera does not open: OSError: no such device"
    device.opens = True
    assert node.trigger_activate() is TransitionCallbackReturn.SUCCESS


def test_a_camera_that_does_not_close_leaves_the_node_as_others_do(node, device):
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


def test_a_frame_whose_time_runs_backwards_is_refused_and_counted(ros, node, device):
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
def test_what_is_no_frame_is_refused_where_it_is_handed_over(node, device, t, frame, sentence):
    assert node.trigger_activate() is TransitionCallbackReturn.SUCCESS
    with pytest.raises(RuntimeError, match="before any calibration"):
        device.port.take(0.0, FRAME)
    device.port.calibrate(calibration())
    with pytest.raises(ValueError, match=sentence):
        device.port.take(t, frame)


def test_a_frame_that_comes_after_the_end_is_left_alone(ros, node, device):
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
