"""Readings of the machine as messages, and back."""

from __future__ import annotations

import math
from functools import reduce
from typing import Any

from geometry_msgs.msg import WrenchStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from winding_core.readings import CABLE_TENSION, AxisReading, Quantity
from winding_ros.stamps import decode_stamp, encode_stamp

CYLINDER_JOINT = "cylinder_joint"
CARRIAGE_JOINT = "carriage_joint"
BASE_FRAME = "winder_axis"


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


def encode_quantity(type_: type, quantity: Quantity, t: float, value: float) -> Any:
    """Return one number of a sensor as a message of a type, stamped t [s]."""
    message = type_()
    message.header.stamp = encode_stamp(t)
    message.header.frame_id = quantity.sensor
    *path, last = quantity.field.split(".")
    setattr(reduce(getattr, path, message), last, float(value))
    return message


def decode_quantity(quantity: Quantity, message: Any) -> tuple[float, float]:
    """Return (t [s], value) of a sensor's message.

    Raises:
        MessageError: The value is not finite.
    """
    value = float(reduce(getattr, quantity.field.split("."), message))
    if not math.isfinite(value):
        raise MessageError(f"{quantity.name} must be finite, got {value} {quantity.unit}")
    return decode_stamp(message.header.stamp), value


def encode_tension(t: float, force: float) -> WrenchStamped:
    """Return the load cell's force [N] along the cable as a wrench stamped t [s]."""
    return encode_quantity(WrenchStamped, CABLE_TENSION, t, force)


def decode_tension(message: WrenchStamped) -> tuple[float, float]:
    """Return (t [s], force [N]) of a load cell message.

    Raises:
        MessageError: The force is not finite.
    """
    return decode_quantity(CABLE_TENSION, message)


def encode_clock(t: float) -> Clock:
    """Return simulated time t [s] as a message."""
    return Clock(clock=encode_stamp(t))


def decode_clock(message: Clock) -> tuple[float, None]:
    """Return simulated time [s], and nothing beside it."""
    return decode_stamp(message.clock), None
