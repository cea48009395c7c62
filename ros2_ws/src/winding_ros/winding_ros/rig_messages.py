"""Readings of the machine as messages, and back."""

from __future__ import annotations

import math
from functools import reduce
from typing import Any

from geometry_msgs.msg import WrenchStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from winding_core.machine_axes import AxisReader, JointSample, MachineAxes
from winding_core.readings import CABLE_TENSION, AxisReading, Quantity
from winding_ros.stamps import decode_stamp, encode_stamp

CYLINDER_JOINT = "cylinder_joint"
CARRIAGE_JOINT = "carriage_joint"
BASE_FRAME = "winder_axis"
_PLAIN_AXES = MachineAxes()


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
    """Return (t [s], reading) of a JointState in radians and metres, whatever its joints' order.

    Raises:
        MessageError: A joint or a velocity is missing, or a number is not finite.
    """
    sample = decode_joint_sample(message, _PLAIN_AXES)
    reading = AxisReader(_PLAIN_AXES).read(sample)
    if math.isnan(sample.cylinder_speed) or math.isnan(sample.carriage_speed):
        raise MessageError(_incomplete(message, _PLAIN_AXES, "position and velocity"))
    return sample.t, reading


def decode_joint_sample(message: JointState, axes: MachineAxes) -> JointSample:
    """Return both joints of a JointState in their own units; a velocity may be missing.

    Raises:
        MessageError: A joint is missing or a number is not finite.
    """
    names = list(message.name)
    try:
        cylinder, carriage = names.index(axes.cylinder_joint), names.index(axes.carriage_joint)
        positions = (message.position[cylinder], message.position[carriage])
    except (ValueError, IndexError):
        raise MessageError(_incomplete(message, axes, "position")) from None
    velocity = message.velocity
    speeds = tuple(
        velocity[joint] if joint < len(velocity) else math.nan for joint in (cylinder, carriage)
    )
    # A velocity that is not a number is one that the driver does not measure.
    if not all(map(math.isfinite, positions)) or any(map(math.isinf, speeds)):
        raise MessageError(f"joint state must be finite, got {(*positions, *speeds)}")
    return JointSample(
        t=decode_stamp(message.header.stamp),
        cylinder=positions[0],
        carriage=positions[1],
        cylinder_speed=speeds[0],
        carriage_speed=speeds[1],
    )


class JointStateReader:
    """Decodes the joint states of one machine, one after the other.

    Args:
        axes: Of the machine.
    """

    def __init__(self, axes: MachineAxes) -> None:
        self.axes = axes
        self._reader = AxisReader(axes)

    def __call__(self, message: JointState) -> tuple[float, AxisReading]:
        """Return (t [s], reading) of a JointState.

        Raises:
            MessageError: A joint is missing or a number is not finite.
        """
        sample = decode_joint_sample(message, self.axes)
        return sample.t, self._reader.read(sample)


def _incomplete(message: JointState, axes: MachineAxes, wanted: str) -> str:
    return (
        f"joint state needs {wanted} of {axes.cylinder_joint} and {axes.carriage_joint}, "
        f"got names {list(message.name)}, {len(message.position)} positions, "
        f"{len(message.velocity)} velocities"
    )


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
