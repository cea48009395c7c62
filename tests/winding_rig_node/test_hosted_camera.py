"""The simulated camera outside the rig's process: it asks the rig what it winds."""

import threading
from collections.abc import Iterator
from typing import Any

import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from winding_core.readings import AxisReading
from winding_rig_node.node import RigNode
from winding_rig_node.ros.hosted_camera import SilentRigError, open_camera
from winding_ros import topics
from winding_ros.rig_messages import encode_joint_state

STANDING = AxisReading(cylinder_angle=0.0, angular_speed=0.0, carriage_position=0.0, feed_speed=0.0)


class Port:
    """Keeps what a camera hands over."""

    def __init__(self, context: Any) -> None:
        self.context = context
        self.times: list[float] = []
        self.failures: list[Exception] = []
        self.fail = self.failures.append

    def calibrate(self, info: Any) -> None:
        """Every calibration will do."""

    def exposed(self, t: float, began_ns: int) -> None:
        """No trace is kept."""

    def take(self, t: float, frame: Any) -> None:
        self.times.append(t)


@pytest.fixture
def rig(ros: Any) -> Iterator[RigNode]:
    """A rig that another thread spins, as if it were another process."""
    node = RigNode(context=ros.context, parameter_overrides=[Parameter("case", value=4)])
    executor = SingleThreadedExecutor(context=ros.context)
    executor.add_node(node)
    ending = threading.Event()

    def spin() -> None:
        while not ending.is_set():
            executor.spin_once(timeout_sec=0.05)

    thread = threading.Thread(target=spin)
    thread.start()
    yield node
    ending.set()
    thread.join()
    executor.shutdown()
    node.destroy_node()


def test_what_was_chosen_since_the_process_was_started_is_filmed(ros, rig):
    rig.set_parameters([Parameter("frame_rate", value=1000)])
    joints, port = topics.JOINT_STATES.advertise(ros.plain()), Port(ros.context)
    with open_camera(port):
        ros.spin_until(lambda: joints.get_subscription_count() == 1)
        for sample in range(3):
            joints.publish(encode_joint_state(0.001 * sample, STANDING))
        ros.spin_until(lambda: len(port.times) == 3)
    assert port.times == [0.0, 0.001, 0.002]


def test_a_reading_that_says_nothing_does_not_end_the_camera(ros, rig):
    joints, port = topics.JOINT_STATES.advertise(ros.plain()), Port(ros.context)
    with open_camera(port):
        ros.spin_until(lambda: joints.get_subscription_count() == 1)
        joints.publish(JointState(name=["another_joint"], position=[0.0]))
        joints.publish(encode_joint_state(0.005, STANDING))
        ros.spin_until(lambda: port.times or port.failures)
    assert port.failures == []
    assert port.times == [0.005]


def test_without_a_rig_the_camera_is_refused_and_leaves_no_node(ros, monkeypatch):
    monkeypatch.setattr("winding_rig_node.ros.hosted_camera._ATTEMPTS", 1)
    probe = ros.plain()
    with (
        pytest.raises(SilentRigError, match="winding_rig does not say within"),
        open_camera(Port(ros.context)),
    ):
        pytest.fail("opened")
    ros.spin_until(lambda: "winding_rig_camera" not in probe.get_node_names())
