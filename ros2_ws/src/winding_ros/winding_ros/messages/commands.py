"""Commands of the machine's axes and brake as messages, and back."""

import math
from collections.abc import Sequence

from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory as TrajectoryMessage

from winding_core.machine.commands import (
    AXES,
    CARRIAGE,
    CYLINDER,
    AxisTarget,
    JointTargets,
    JointTrajectory,
    TensionCommand,
    Waypoint,
)
from winding_core.machine.readings import CABLE_TENSION
from winding_ros.messages.rig import CARRIAGE_JOINT, CYLINDER_JOINT, decode_tension
from winding_ros.messages.serialised import MessageError
from winding_ros.messages.stamps import decode_stamp, encode_stamp

_JOINTS = {CYLINDER: CYLINDER_JOINT, CARRIAGE: CARRIAGE_JOINT}
_AXES = {joint: axis for axis, joint in _JOINTS.items()}


def encode_targets(command: JointTargets) -> JointState:
    """Return targets as a JointState; NaN stands for what is not commanded."""
    targets = command.axes.values()
    message = JointState(name=[_JOINTS[axis] for axis in command.axes])
    message.position = [math.nan if item.position is None else item.position for item in targets]
    message.velocity = [math.nan if item.speed is None else item.speed for item in targets]
    message.header.stamp = encode_stamp(command.t)
    return message


def decode_targets(message: JointState) -> tuple[float, JointTargets]:
    """Return (t [s], targets) of a JointState; NaN and absent lists command nothing.

    Raises:
        MessageError: A joint is unknown or named twice, a list has another length than the names,
            a number is infinite, an effort is commanded, or nothing is.
    """
    axes = _axes(message.name)
    count = len(axes)
    for name in ("position", "velocity", "effort"):
        if len(getattr(message, name)) not in (0, count):
            raise MessageError(
                f"joint targets need no {name} or one for each of {count} joints, "
                f"got {len(getattr(message, name))}"
            )
    if any(not math.isnan(number) for number in message.effort):
        raise MessageError("joint targets must be positions or velocities, got an effort")
    positions = _wanted("position", message.position) or [None] * count
    speeds = _wanted("velocity", message.velocity) or [None] * count
    targets = {
        axis: AxisTarget(position=position, speed=speed)
        for axis, position, speed in zip(axes, positions, speeds, strict=True)
        if position is not None or speed is not None
    }
    if not targets:
        raise MessageError("joint targets need a position or a velocity, got none")
    t = decode_stamp(message.header.stamp)
    return t, JointTargets(t=t, axes=targets)


def decode_trajectory(message: TrajectoryMessage) -> tuple[float, JointTrajectory]:
    """Return (t [s], trajectory) of a JointTrajectory; without points its joints hold.

    Accelerations and efforts of the points are left aside.

    Raises:
        MessageError: A joint is unknown or named twice, a point lacks a position or has a number
            that is not finite, velocities stand in some points only, or times do not ascend.
    """
    axes = _axes(message.joint_names)
    if message.points and not axes:
        raise MessageError("a trajectory with points needs joint_names, got none")
    fast = bool(message.points and message.points[0].velocities)
    last = -1.0
    waypoints: dict[str, tuple[Waypoint, ...]] = dict.fromkeys(axes or AXES, ())
    for k, point in enumerate(message.points):
        t = float(point.time_from_start.sec) + 1.0e-9 * float(point.time_from_start.nanosec)
        if not t > last or t < 0.0:
            raise MessageError(
                f"time_from_start must ascend from 0 s, point {k} has {t:g} s after {last:g} s"
            )
        last = t
        if len(point.positions) != len(axes) or len(point.velocities) != fast * len(axes):
            raise MessageError(
                f"a trajectory needs {len(axes)} positions in each point, and velocities in each "
                f"or none, point {k} has {len(point.positions)} and {len(point.velocities)}"
            )
        if not all(map(math.isfinite, (*point.positions, *point.velocities))):
            raise MessageError(f"a trajectory must be finite, point {k} is not")
        speeds: Sequence[float | None] = point.velocities or [None] * len(axes)
        for axis, position, speed in zip(axes, point.positions, speeds, strict=True):
            waypoints[axis] += (Waypoint(t=t, position=position, speed=speed),)
    t = decode_stamp(message.header.stamp)
    return t, JointTrajectory(t=t, axes=waypoints)


def encode_tension_command(command: TensionCommand) -> WrenchStamped:
    """Return a pull that the brake shall have as a wrench."""
    message = WrenchStamped()
    message.header.stamp = encode_stamp(command.t)
    message.header.frame_id = CABLE_TENSION.sensor
    message.wrench.force.x = command.force
    return message


def decode_tension_command(message: WrenchStamped) -> tuple[float, TensionCommand]:
    """Return (t [s], command) of a pull that the brake shall have.

    Raises:
        MessageError: The force is not finite.
    """
    t, force = decode_tension(message)
    return t, TensionCommand(t=t, force=force)


def _axes(joints: Sequence[str]) -> list[str]:
    """Return the axes of joints, in their order.

    Raises:
        MessageError: A joint is unknown or named twice.
    """
    for joint in joints:
        if joint not in _AXES or list(joints).count(joint) > 1:
            raise MessageError(
                f"joints must be {' and '.join(_AXES)}, each once at most, got {list(joints)}"
            )
    return [_AXES[joint] for joint in joints]


def _wanted(name: str, numbers: Sequence[float]) -> list[float | None]:
    """Return numbers with None for NaN.

    Raises:
        MessageError: One is infinite.
    """
    if any(map(math.isinf, numbers)):
        raise MessageError(f"joint targets must be finite or NaN, got {name} {list(numbers)}")
    return [None if math.isnan(number) else float(number) for number in numbers]
