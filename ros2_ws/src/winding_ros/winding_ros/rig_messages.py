"""Readings of the machine as messages, and back."""

from __future__ import annotations

import math

from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState

from winding_core.readings import AxisReading
from winding_ros.stamps import decode_stamp, encode_stamp

CYLINDER_JOINT = "cylinder_joint"
CARRIAGE_JOINT = "carriage_joint"
BASE_FRAME = "winder_axis"
LOAD_CELL_FRAME = "load_cell"


class MessageError(ValueError):
    """A message does not say what its topic promises."""


def encode_joint_state(t: float, reading: AxisReading) -> JointState:
    """Return both axes as a JointState stamped t [s]."""
    message = JointState(
        name=[CYLINDER_JOINT, CARRIAGE_JOINT],
        position=[reading.cylinder_angle, reading.carriage_position],
        velocity=[reading.angular_speed, reading.feed_speed],
    )
    message.header.stamp = encode_stamp(t)
    message.header.frame_id = BASE_FRAME
    return message


def decode_joint_state(message: JointState) -> tuple[float, AxisReading]:
    """Return (t [s], reading) of a JointState, whatever the order of its joints.

    Raises:
        MessageError: A joint is missing or a number is not finite.
    """
    names = list(message.name)
    try:
        cylinder, carriage = names.index(CYLINDER_JOINT), names.index(CARRIAGE_JOINT)
        reading = AxisReading(
            cylinder_angle=message.position[cylinder],
            angular_speed=message.velocity[cylinder],
            carriage_position=message.position[carriage],
            feed_speed=message.velocity[carriage],
        )
    except (ValueError, IndexError):
        raise MessageError(
            f"joint state needs position and velocity of {CYLINDER_JOINT} and {CARRIAGE_JOINT}, "
            f"got names {names}, {len(message.position)} positions, "
            f"{len(message.velocity)} velocities"
        ) from None
    numbers = (
        reading.cylinder_angle,
        reading.angular_speed,
        reading.carriage_position,
        reading.feed_speed,
    )
    if not all(map(math.isfinite, numbers)):
        raise MessageError(f"joint state must be finite, got {numbers}")
    return decode_stamp(message.header.stamp), reading


def encode_tension(t: float, force: float) -> WrenchStamped:
    """Return the load cell's force [N] along the cable as a wrench stamped t [s]."""
    message = WrenchStamped()
    message.header.stamp = encode_stamp(t)
    message.header.frame_id = LOAD_CELL_FRAME
    message.wrench.force.x = float(force)
    return message


def decode_tension(message: WrenchStamped) -> tuple[float, float]:
    """Return (t [s], force [N]) of a load cell message.

    Raises:
        MessageError: The force is not finite.
    """
    force = message.wrench.force.x
    if not math.isfinite(force):
        raise MessageError(f"tension must be finite, got {force} N")
    return decode_stamp(message.header.stamp), force
