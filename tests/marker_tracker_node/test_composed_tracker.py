"""A camera in the tracker's process: opened with the node's activation, closed with its end."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter

from marker_tracker_node.node import ComposedTrackerNode
from winding_core.status import Level


class Device:
    """A camera that may be broken."""

    def __init__(self) -> None:
        self.opens = self.closes = True
        self.opened = 0

    @contextmanager
    def open_camera(self, port: Any) -> Iterator[None]:
        if not self.opens:
            raise OSError("no such device")
        self.opened += 1
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


def test_the_camera_is_open_while_the_node_is_active(
    node: ComposedTrackerNode, device: Device
) -> None:
    for _ in range(2):
        assert node.trigger_activate() is TransitionCallbackReturn.SUCCESS
        assert device.opened == 1
        assert node.trigger_deactivate() is TransitionCallbackReturn.SUCCESS
        assert device.opened == 0


def test_a_camera_that_does_not_open_is_refused_and_may_open_later(
    node: ComposedTrackerNode, device: Device
) -> None:
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
