"""ROS side of the driver: cylinder, arm and targets in; joint states and commands out."""

import time
from collections import Counter
from collections.abc import Callable
from typing import Any

from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from winding_arm_driver.guide import WAIT, Guided
from winding_arm_driver.leading import Led
from winding_arm_driver.ros.foreign_interfaces import TrajectoryGoals, interface
from winding_core.arm.arm_file import (
    ACTION,
    JOINTS,
    NONE,
    POSE,
    POSITIONS,
    TF,
    TRAJECTORY,
    TWIST,
    ArmMapping,
)
from winding_core.arm.rigid import Pose
from winding_core.status import Level, Status
from winding_ros import services, topics
from winding_ros.messages.commands import decode_targets
from winding_ros.messages.diagnostics import encode_diagnostics
from winding_ros.messages.rig import encode_joint_state
from winding_ros.messages.serialised import MessageError
from winding_ros.messages.stamps import encode_stamp, stamp_bytes_of, with_stamp

NAME = "winding_arm"
# Two seconds at 1000 Hz.
_DEPTH = 2000
_REPORT = 1.0
# Reasons may hold numbers that are never the same.
_MOST_REASONS = 100
_NANO = 1_000_000_000
_COMMANDS = {
    POSE: PoseStamped,
    TWIST: TwistStamped,
    TRAJECTORY: JointTrajectory,
    POSITIONS: Float64MultiArray,
}


class ArmDriverNode(Node):  # type: ignore[misc]
    """Plain node: publishes rig/joint_states, the arm's commands and /diagnostics.

    Raises:
        MappingError: TF is to be read or an action called, and its interfaces are not installed.
        ArmError: The arm's description cannot be used.
    """

    def __init__(self, mapping: ArmMapping, *, context: Context) -> None:
        super().__init__(NAME, context=context)
        self._mapping, self._guided = mapping, Guided(mapping)
        self._refused: Counter[str] = Counter()
        self._reported = ""
        self._led_at, self._stopped = -1.0, False
        self._joint_states = topics.JOINT_STATES.advertise(self)
        self._diagnostics = topics.DIAGNOSTICS.advertise(self)
        cylinder, guide, commands = mapping.cylinder, mapping.guide, mapping.commands
        if (guide.source, guide.topic) == (JOINTS, cylinder.topic):
            self._listen(JointState, guide.topic, self._both)
        else:
            self._listen(JointState, cylinder.topic, self._cylinder)
        if guide.source == JOINTS and guide.topic != cylinder.topic:
            self._listen(JointState, guide.topic, self._joints)
        elif guide.source == TF:
            self._listen_to_tf()
        elif guide.source == POSE:
            self._listen(PoseStamped, guide.topic, self._pose)
        if commands.type != NONE:
            self._commands = (
                TrajectoryGoals(self, commands.topic, time.monotonic, self._refuse)
                if commands.type == ACTION
                else self.create_publisher(_COMMANDS[commands.type], commands.topic, 1)
            )
            self._listen(topics.JOINT_TARGETS.type, topics.JOINT_TARGETS.name, self._target, 1)
            self._stop = self.create_client(services.STOP.type, services.STOP.name)
            self.create_timer(1.0 / commands.rate_hz, self._lead)
        # What still waits for its other half when nothing arrives any more.
        self.create_timer(WAIT, self._publish)
        self.create_timer(_REPORT, self._report)
        self.get_logger().info("ready")

    def _listen(
        self, type_: type, topic: str, take: Callable[[Any], None], qos: QoSProfile | int = _DEPTH
    ) -> None:
        def taken(message: Any) -> None:
            try:
                take(message)
            except (MessageError, ValueError) as error:
                self._refuse(str(error))
            self._publish()

        self.create_subscription(type_, topic, taken, qos)

    def _refuse(self, reason: str) -> None:
        known = reason in self._refused or len(self._refused) < _MOST_REASONS
        self._refused[reason if known else "refused for other reasons"] += 1

    def _listen_to_tf(self) -> None:
        type_ = interface(
            "tf2_msgs", "msg", "TFMessage", needing="source tf", otherwise="source pose or joints"
        )
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._listen(type_, "/tf", self._transforms)
        self._listen(type_, "/tf_static", self._static, latched)

    def _cylinder(self, message: JointState) -> None:
        joint, names = self._mapping.cylinder.joint, list(message.name)
        if joint not in names or len(message.position) <= names.index(joint):
            raise MessageError(f"joint states of the cylinder lack {joint}, got {names}")
        position = float(message.position[names.index(joint)])
        self._guided.add_cylinder(_stamp_ns(message.header.stamp), position, time.monotonic())

    def _both(self, message: JointState) -> None:
        self._cylinder(message)
        self._joints(message)

    def _joints(self, message: JointState) -> None:
        by_name = dict(zip(message.name, map(float, message.position), strict=False))
        self._guided.add_joints(_stamp_ns(message.header.stamp), by_name, time.monotonic())

    def _pose(self, message: PoseStamped) -> None:
        base, frame = self._mapping.guide.base, message.header.frame_id
        if frame != base:
            raise MessageError(f"the guide's pose must be given in {base}, got {frame or 'none'}")
        place, turn = message.pose.position, message.pose.orientation
        tip = Pose.of([place.x, place.y, place.z], [turn.x, turn.y, turn.z, turn.w])
        self._guided.add_tip(_stamp_ns(message.header.stamp), tip, time.monotonic())

    def _static(self, message: Any) -> None:
        for item in message.transforms:
            place, turn = item.transform.translation, item.transform.rotation
            pose = Pose.of([place.x, place.y, place.z], [turn.x, turn.y, turn.z, turn.w])
            self._guided.add_transform(item.header.frame_id, item.child_frame_id, pose)

    def _transforms(self, message: Any) -> None:
        self._static(message)
        stamps = {item.child_frame_id: _stamp_ns(item.header.stamp) for item in message.transforms}
        self._guided.look_up(stamps, time.monotonic())

    def _target(self, message: JointState) -> None:
        _, targets = decode_targets(message)
        self._guided.aim(targets, self._now(), turning=self._guided.turning(time.monotonic()))

    def _publish(self) -> None:
        for stamp_ns, reading in self._guided.readings(time.monotonic()):
            data = with_stamp(encode_joint_state(0.0, reading), stamp_bytes_of(stamp_ns))
            self._joint_states.publish(data)

    def _lead(self) -> None:
        now = self._now()
        passed, self._led_at = now - self._led_at, now
        period = 1.0 / self._mapping.commands.rate_hz
        # A timer that comes late goes on no further than two periods at once.
        passed = min(max(passed, 0.1 * period), 2.0 * period)
        turning = self._guided.turning(time.monotonic())
        led = self._guided.advance(now, passed, turning=turning)
        if led is not None:
            self._commands.publish(self._message(led, now))
        lead = self._guided.lead
        if lead.late and turning and not self._stopped:
            # Both axes of a machine stop by a controlled stop when its commander is gone.
            self._stop.call_async(services.STOP.type.Request())
        self._stopped = lead.late
        if lead.remark != self._reported:
            self._reported = lead.remark
            self.get_logger().warning(lead.remark or "the guide follows its targets again")

    def _message(self, led: Led, now: float) -> Any:
        kind, base = self._mapping.commands.type, self._mapping.guide.base
        if kind == POSE:
            message = PoseStamped()
            place, turn = message.pose.position, message.pose.orientation
            place.x, place.y, place.z = led.tip.position.tolist()
            turn.x, turn.y, turn.z, turn.w = led.tip.quaternion.tolist()
        elif kind == TWIST:
            message = TwistStamped()
            way = message.twist.linear
            way.x, way.y, way.z = led.velocity.tolist()
        elif kind == POSITIONS:
            assert led.joints is not None
            size = len(led.joints)
            layout = MultiArrayLayout(
                dim=[MultiArrayDimension(label="joints", size=size, stride=size)]
            )
            return Float64MultiArray(layout=layout, data=led.joints.tolist())
        else:
            assert led.joints is not None
            assert led.joint_speeds is not None
            period = round(_NANO / self._mapping.commands.rate_hz)
            point = JointTrajectoryPoint(
                positions=led.joints.tolist(),
                velocities=led.joint_speeds.tolist(),
                time_from_start=Duration(sec=period // _NANO, nanosec=period % _NANO),
            )
            # Stamp zero is now, as joint_trajectory_controller has it.
            return JointTrajectory(joint_names=self._guided.joint_names, points=[point])
        message.header.frame_id = base
        message.header.stamp = encode_stamp(now)
        return message

    def _report(self) -> None:
        silence = self._guided.silence(time.monotonic())
        refused = [f"{count} x {reason}" for reason, count in self._refused.most_common(3)]
        remark = self._guided.lead.remark
        level = Level.ERROR if silence else Level.WARN if refused or remark else Level.OK
        message = "; ".join(filter(None, [silence, remark, *refused])) or "the guide is followed"
        status = Status(name=NAME, level=level, message=message)
        self._diagnostics.publish(
            encode_diagnostics(time.time(), [status], self._mapping.guide.base)
        )

    def _now(self) -> float:
        return float(self.get_clock().now().nanoseconds) / _NANO


def _stamp_ns(stamp: Time) -> int:
    return int(stamp.sec) * _NANO + int(stamp.nanosec)
