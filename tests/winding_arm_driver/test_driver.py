"""The driver beside an arm of its own joints, dead time and command type, over real DDS."""

import math
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from arms import EYE, HOME, NAMES, mapping_text, tool
from geometry_msgs.msg import PoseStamped, TwistStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from winding_arm_driver.node import ArmDriverNode
from winding_core.arm.arm_file import ArmMapping, parse_mapping
from winding_core.arm.rigid import Pose
from winding_core.machine.axes import MachineAxes
from winding_core.machine.commands import CARRIAGE, AxisTarget, JointTargets
from winding_core.machine.readings import AxisReading
from winding_ros import topics
from winding_ros.messages.commands import encode_targets
from winding_ros.messages.diagnostics import decode_diagnostics
from winding_ros.messages.rig import JointStateReader

PERIOD, DEAD_TIME = 0.008, 0.015
TURN = 40.0  # Of the encoder in degrees


class OwnArm:
    """Takes commands of one type after a dead time, and reports what it does with them."""

    def __init__(self, node: Any, mapping: ArmMapping) -> None:
        self._node, self._mapping = node, mapping
        self.joints = HOME.copy()
        placed = tool(HOME)
        self.tip = Pose(position=placed[:3, 3], rotation=placed[:3, :3])
        self._velocity, self._angle = np.zeros(3), TURN
        self._waiting: deque[tuple[float, Callable[[], None]]] = deque()
        guide, commands = mapping.guide, mapping.commands
        kind = JointState if guide.source == "joints" else PoseStamped
        self._states = node.create_publisher(kind, guide.topic, 100)
        self._encoder = node.create_publisher(JointState, mapping.cylinder.topic, 100)
        taken: tuple[type, Callable[[Any], None]] = {
            "trajectory": (JointTrajectory, self._trajectory),
            "positions": (Float64MultiArray, self._positions),
            "pose": (PoseStamped, self._pose),
            "twist": (TwistStamped, self._twist),
        }[commands.type]
        node.create_subscription(taken[0], commands.topic, self._late(taken[1]), 10)
        node.create_timer(PERIOD, self._step)

    def eye(self) -> np.ndarray:
        """Return where the eye truly is in `winder_axis` [m]."""
        eye = self.tip.point(EYE)
        if self._mapping.guide.source == "joints":
            placed = tool(self.joints)
            eye = placed[:3, :3] @ EYE + placed[:3, 3]
        return self._mapping.winder_axis.pose.inverse().point(eye)

    def _now(self) -> float:
        return float(self._node.get_clock().now().nanoseconds) * 1.0e-9

    def _late(self, take: Callable[[Any], None]) -> Callable[[Any], None]:
        return lambda message: self._waiting.append(
            (self._now() + DEAD_TIME, lambda: take(message))
        )

    def _trajectory(self, message: JointTrajectory) -> None:
        places = [message.joint_names.index(name) for name in NAMES]
        self.joints = np.array(message.points[-1].positions)[places]

    def _positions(self, message: Float64MultiArray) -> None:
        self.joints = np.array(message.data)

    def _pose(self, message: PoseStamped) -> None:
        assert message.header.frame_id == "base_link"
        place, turn = message.pose.position, message.pose.orientation
        self.tip = Pose.of([place.x, place.y, place.z], [turn.x, turn.y, turn.z, turn.w])

    def _twist(self, message: TwistStamped) -> None:
        way = message.twist.linear
        self._velocity = np.array([way.x, way.y, way.z])

    def _step(self) -> None:
        while self._waiting and self._waiting[0][0] <= self._now():
            self._waiting.popleft()[1]()
        place = self.tip.position + PERIOD * self._velocity
        self.tip = Pose(position=place, rotation=self.tip.rotation)
        stamp = self._node.get_clock().now().to_msg()
        self._angle += 0.5
        encoder = JointState(name=["spindle", "table"], position=[0.0, self._angle])
        encoder.header.stamp = stamp
        if self._mapping.guide.source == "joints":
            # In an order of its own, beside a gripper.
            state: Any = JointState(name=["gripper", *reversed(NAMES)])
            state.position = [0.0, *reversed(self.joints.tolist())]
        else:
            state = PoseStamped()
            state.header.frame_id = "base_link"
            at, turn = state.pose.position, state.pose.orientation
            at.x, at.y, at.z = self.tip.position.tolist()
            turn.x, turn.y, turn.z, turn.w = self.tip.quaternion.tolist()
        state.header.stamp = stamp
        self._encoder.publish(encoder)
        self._states.publish(state)


def mapping_of(folder: Path, source: str, kind: str) -> ArmMapping:
    text = mapping_text(folder, type=kind, ahead_s=DEAD_TIME)
    values = yaml.safe_load(text)
    values["guide"]["source"] = source
    return parse_mapping(yaml.safe_dump(values), folder)


@pytest.mark.parametrize(
    ("source", "kind"),
    [("joints", "trajectory"), ("joints", "positions"), ("pose", "pose"), ("pose", "twist")],
)
def test_arm_of_its_own_is_followed_and_led(
    ros: Any, tmp_path: Path, source: str, kind: str
) -> None:
    mapping = mapping_of(tmp_path, source, kind)
    ros.add(ArmDriverNode, mapping)
    cell = ros.plain("cell")
    arm = OwnArm(cell, mapping)
    read, readings = JointStateReader(MachineAxes()), list[AxisReading]()
    listener = ros.plain("listener")
    states = topics.JOINT_STATES
    listener.create_subscription(
        states.type, states.name, lambda message: readings.append(read(message)[1]), states.qos
    )
    targets = listener.create_publisher(topics.JOINT_TARGETS.type, topics.JOINT_TARGETS.name, 1)
    ros.spin_until(lambda: readings)
    first = readings[-1]
    steps = math.degrees(first.cylinder_angle) - TURN
    assert steps == pytest.approx(0.5 * round(2.0 * steps), abs=1.0e-9)
    assert first.guide is not None
    # Of the decimals in mapping and description [m].
    assert (first.guide.x, first.guide.y) == pytest.approx((0.02, -0.2), abs=1.0e-8)
    assert first.carriage_position == pytest.approx(0.0, abs=1.0e-8)
    goal = 0.03

    def aimed() -> bool:
        target = JointTargets(t=0.0, axes={CARRIAGE: AxisTarget(position=goal)})
        targets.publish(encode_targets(target))
        return abs(arm.eye()[2] - goal) < 5.0e-4

    ros.spin_until(aimed)
    ros.spin_until(lambda: readings[-1].carriage_position == pytest.approx(arm.eye()[2], abs=1e-4))
    assert arm.eye()[:2] == pytest.approx((0.02, -0.2), abs=1.0e-5)


def test_what_cannot_be_used_is_reported_with_its_number(ros: Any, tmp_path: Path) -> None:
    mapping = mapping_of(tmp_path, "joints", "trajectory")
    ros.add(ArmDriverNode, mapping)
    arm = OwnArm(ros.plain("cell"), mapping)
    listener = ros.plain("listener")
    messages = list[str]()

    def note(message: Any) -> None:
        _, statuses = decode_diagnostics(message)
        messages.extend(status.message for status in statuses)

    listener.create_subscription(topics.DIAGNOSTICS.type, topics.DIAGNOSTICS.name, note, 10)
    targets = listener.create_publisher(topics.JOINT_TARGETS.type, topics.JOINT_TARGETS.name, 1)
    far = JointTargets(t=0.0, axes={CARRIAGE: AxisTarget(position=0.7)})

    def reported() -> bool:
        targets.publish(encode_targets(far))
        return any("must stay within -0.05 to 0.5 m, got 0.7 m" in text for text in messages)

    ros.spin_until(reported)
    assert arm.joints == pytest.approx(HOME)


@pytest.mark.processes
@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"guide": {"source": "tf"}}, "source tf needs the messages of tf2_msgs"),
        ({"guide": {"source": "joints", "urdf": "none.urdf"}}, "none.urdf is no robot description"),
        ({"guide": {"source": "yoints"}}, "source must be one of joints, pose, tf, got 'yoints'"),
    ],
)
def test_mapping_that_cannot_be_used_ends_the_driver(
    tmp_path: Path, change: dict[str, dict[str, str]], sentence: str
) -> None:
    file = tmp_path / "arm.yaml"
    file.write_text(yaml.safe_dump(change))
    command = [sys.executable, "-m", "winding_arm_driver", "--mapping", str(file)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert sentence in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.processes
def test_driver_ends_with_zero_on_a_signal(ros: Any, tmp_path: Path) -> None:
    file = tmp_path / "arm.yaml"
    file.write_text(mapping_text(tmp_path))
    command = [sys.executable, "-m", "winding_arm_driver", "--mapping", str(file)]
    driver = subprocess.Popen(command)
    try:
        node = ros.plain()
        ros.spin_until(lambda: node.count_publishers(topics.JOINT_STATES.name) == 1)
        driver.send_signal(signal.SIGINT)
        assert driver.wait() == 0
    finally:
        driver.kill()
