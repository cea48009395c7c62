"""An arm of its own joints, dead time and command type; in a process of its own as a script.

python own_arm.py MAPPING ENDING, where a goal's ending is one of follow, reject, abort and absent.
"""

import importlib
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from arms import DEAD_TIME, EYE, HOME, NAMES, tool
from geometry_msgs.msg import PoseStamped, TransformStamped, TwistStamped
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from winding_core.arm.arm_file import ArmMapping, read_mapping
from winding_core.arm.rigid import Pose

PERIOD = 0.008
TURN = 40.0  # Of the encoder in degrees


# Where a part of the arm that is reported once stands in the base, and all that others report.
RISER = Pose.of([0.3, -0.2, 0.1], [0.0, 0.0, 0.6, 0.8])
FOLLOW, REJECT, ABORT, ABSENT = "follow", "reject", "abort", "absent"


class OwnArm:
    """Takes commands of one type after a dead time, and reports what it does with them.

    Args:
        node: Whose topics they are.
        mapping: What it reports and takes.
        ending: What becomes of a goal, where it takes goals.
    """

    def __init__(self, node: Any, mapping: ArmMapping, ending: str = FOLLOW) -> None:
        self._node, self._mapping = node, mapping
        self.joints = HOME.copy()
        placed = tool(HOME)
        self.tip = Pose(position=placed[:3, 3], rotation=placed[:3, :3])
        self._velocity, self._angle = np.zeros(3), TURN
        self._waiting: deque[tuple[float, Callable[[], None]]] = deque()
        guide, commands = mapping.guide, mapping.commands
        self._encoder = node.create_publisher(JointState, mapping.cylinder.topic, 100)
        if guide.source == "tf":
            self._message = importlib.import_module("tf2_msgs.msg").TFMessage
            latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
            self._static = node.create_publisher(self._message, "/tf_static", latched)
            standing = [
                transform("base_link", "riser", RISER),
                transform("world", "base_link", RISER),
            ]
            self._static.publish(self._message(transforms=standing))
            self._states = node.create_publisher(self._message, "/tf", 100)
        else:
            kind = JointState if guide.source == "joints" else PoseStamped
            self._states = node.create_publisher(kind, guide.topic, 100)
        if commands.type == "action":
            if ending != ABSENT:
                self._serve(ending)
        else:
            taken: tuple[type, Callable[[Any], None]] = {
                "trajectory": (JointTrajectory, self._trajectory),
                "positions": (Float64MultiArray, self._positions),
                "pose": (PoseStamped, self._pose),
                "twist": (TwistStamped, self._twist),
            }[commands.type]
            node.create_subscription(taken[0], commands.topic, self._late(taken[1]), 10)
        node.create_timer(PERIOD, self._step)

    def _serve(self, ending: str) -> None:
        type_ = importlib.import_module("control_msgs.action").FollowJointTrajectory

        def execute(handle: Any) -> Any:
            if ending == ABORT:
                handle.abort()
                code = type_.Result.PATH_TOLERANCE_VIOLATED
                return type_.Result(error_code=code, error_string="pan left its tolerance")
            self._late(self._trajectory)(handle.request.trajectory)
            handle.succeed()
            return type_.Result()

        self._server = ActionServer(
            self._node,
            type_,
            self._mapping.commands.topic,
            execute,
            goal_callback=lambda _: (
                GoalResponse.REJECT if ending == REJECT else GoalResponse.ACCEPT
            ),
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )

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
        self._encoder.publish(encoder)
        if self._mapping.guide.source == "joints":
            # In an order of its own, beside a gripper.
            state: Any = JointState(name=["gripper", *reversed(NAMES)])
            state.position = [0.0, *reversed(self.joints.tolist())]
        elif self._mapping.guide.source == "tf":
            moved = transform("riser", "tool0", RISER.inverse() @ self.tip)
            moved.header.stamp = stamp
            self._states.publish(self._message(transforms=[moved]))
            # Others publish, too, and later.
            vehicle = transform("world", "vehicle", RISER)
            vehicle.header.stamp = self._node.get_clock().now().to_msg()
            self._states.publish(self._message(transforms=[vehicle]))
            return
        else:
            state = PoseStamped()
            state.header.frame_id = "base_link"
            at, turn = state.pose.position, state.pose.orientation
            at.x, at.y, at.z = self.tip.position.tolist()
            turn.x, turn.y, turn.z, turn.w = self.tip.quaternion.tolist()
        state.header.stamp = stamp
        self._states.publish(state)


def transform(parent: str, child: str, pose: Pose) -> TransformStamped:
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id = parent
    place, turn = message.transform.translation, message.transform.rotation
    place.x, place.y, place.z = pose.position.tolist()
    turn.x, turn.y, turn.z, turn.w = pose.quaternion.tolist()
    return message


if __name__ == "__main__":
    ended = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: ended.set())
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    own = rclpy.create_node("own_arm", namespace="own_cell")
    arm = OwnArm(own, read_mapping(Path(sys.argv[1])), sys.argv[2])
    print("ready", flush=True)
    while not ended.is_set():
        rclpy.spin_once(own, timeout_sec=0.1)
