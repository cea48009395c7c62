"""Readings of the machine as messages, and back; where their numbers stand in the bytes."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from functools import cache, reduce
from typing import Any

from geometry_msgs.msg import WrenchStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from winding_core.machine.axes import AxisReader, JointSample, MachineAxes
from winding_core.machine.readings import CABLE_TENSION, AxisReading, GuidePlace, Quantity
from winding_ros.messages.cdr import CdrError, CdrReader, Template, number_at, serialised
from winding_ros.messages.serialised import MessageError, deserialised
from winding_ros.messages.stamps import decode_stamp, serialised_stamp

CYLINDER_JOINT = "cylinder_joint"
CARRIAGE_JOINT = "carriage_joint"
# Joints of a guide that does not keep its place across the axis, along x and y of BASE_FRAME [m].
GUIDE_JOINTS = ("guide_x_joint", "guide_y_joint")
BASE_FRAME = "winder_axis"
_PLAIN_AXES = MachineAxes()
_DOUBLE = struct.Struct("<d")
_NUMBERS = {"double": _DOUBLE, "float": struct.Struct("<f")}


def encode_joint_state(
    t: float, reading: AxisReading, names: tuple[str, ...] = (), positions: tuple[float, ...] = ()
) -> bytes:
    """Return both axes as the CDR bytes of a JointState, and the guide's place.

    Args:
        t: Its stamp [s].
        reading: The axes.
        names: Further joints, such as those of an arm.
        positions: Where they stand [rad or m], shape (names,).
    """
    guide = reading.guide
    template, layout, further = _joint_state_template(guide is not None, names)
    into, message = _DOUBLE.pack_into, template.stamped(t)
    cylinder, carriage = layout.positions
    fast, slow = layout.velocities
    assert fast is not None
    assert slow is not None
    into(message, cylinder, reading.cylinder_angle)
    into(message, carriage, reading.carriage_position)
    into(message, fast, reading.angular_speed)
    into(message, slow, reading.feed_speed)
    if guide is not None and layout.guide is not None:
        into(message, layout.guide[0], guide.x)
        into(message, layout.guide[1], guide.y)
    for k, position in enumerate(positions):
        into(message, further + k * _DOUBLE.size, position)
    return bytes(message)


@cache
def _joint_state_template(
    guided: bool, further: tuple[str, ...]
) -> tuple[Template, JointStateLayout, int]:
    """Return the message, where its numbers stand, and where further positions begin."""
    own = [CYLINDER_JOINT, CARRIAGE_JOINT, *(GUIDE_JOINTS if guided else ())]
    zeros = [0.0] * (len(own) + len(further))
    message = JointState(name=[*own, *further], position=zeros, velocity=zeros)
    message.header.frame_id = BASE_FRAME
    template = Template.of(message)
    layout = JointStateLayout.of(template.data, (CYLINDER_JOINT, CARRIAGE_JOINT))
    return template, layout, layout.positions[0] + len(own) * _DOUBLE.size


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
    velocity = message.velocity
    try:
        places = _places(list(message.name), (axes.cylinder_joint, axes.carriage_joint))
        cylinder, carriage, *across = (float(message.position[place]) for place in places)
    except (ValueError, IndexError):
        raise MessageError(_incomplete(message, axes, "position")) from None
    fast, slow = (velocity[k] if k < len(velocity) else math.nan for k in places[:2])
    return _finite(
        JointSample(
            t=decode_stamp(message.header.stamp),
            cylinder=cylinder,
            carriage=carriage,
            cylinder_speed=fast,
            carriage_speed=slow,
            guide=GuidePlace(x=across[0], y=across[1]) if across else None,
        )
    )


def _places(names: list[str], joints: tuple[str, str]) -> list[int]:
    """Return the places of two joints among names, and those of the guide's if there are any."""
    guide = GUIDE_JOINTS if set(GUIDE_JOINTS) <= set(names) else ()
    return [names.index(joint) for joint in (*joints, *guide)]


class JointStateReader:
    """Decodes the joint states of one machine, one after the other.

    Messages of one driver look alike: only the first is taken apart as a message object.
    """

    def __init__(self, axes: MachineAxes) -> None:
        self.axes = axes
        self._joints = (axes.cylinder_joint, axes.carriage_joint)
        self._reader = AxisReader(axes)
        self._layout: JointStateLayout | None = None

    def __call__(self, message: bytes | JointState) -> tuple[float, AxisReading]:
        """Return (t [s], reading) of a JointState or of its CDR bytes.

        Raises:
            MessageError: They are none, a joint is missing or a number is not finite.
        """
        if isinstance(message, bytes):
            sample = self._sample(message)
        else:
            sample = decode_joint_sample(message, self.axes)
        return sample.t, self._reader.read(sample)

    def _sample(self, data: bytes) -> JointSample:
        layout = self._layout
        if layout is None or not layout.fits(data):
            sample = decode_joint_sample(deserialised(data, JointState), self.axes)
            try:
                self._layout = JointStateLayout.of(data, self._joints)
            except CdrError:
                self._layout = None
            return sample
        return _finite(layout.sample(data))


def _finite(sample: JointSample) -> JointSample:
    positions = (sample.cylinder, sample.carriage)
    speeds = (sample.cylinder_speed, sample.carriage_speed)
    # A velocity that is not a number is one that the driver does not measure.
    if not all(map(math.isfinite, positions)) or any(map(math.isinf, speeds)):
        raise MessageError(f"joint state must be finite, got {(*positions, *speeds)}")
    guide = sample.guide
    if guide is not None and not (math.isfinite(guide.x) and math.isfinite(guide.y)):
        raise MessageError(f"the guide's place must be finite, got ({guide.x}, {guide.y}) m")
    return sample


def _incomplete(message: JointState, axes: MachineAxes, wanted: str) -> str:
    return (
        f"joint state needs {wanted} of {axes.cylinder_joint} and {axes.carriage_joint}, "
        f"got names {list(message.name)}, {len(message.position)} positions, "
        f"{len(message.velocity)} velocities"
    )


def encode_quantity(type_: type, quantity: Quantity, t: float, value: float) -> bytes:
    """Return one number of a sensor as the CDR bytes of a message of a type, stamped t [s]."""
    template, place, number = _quantity_template(type_, quantity)
    message = template.stamped(t)
    number.pack_into(message, place, float(value))
    return bytes(message)


@cache
def _quantity_template(type_: type, quantity: Quantity) -> tuple[Template, int, struct.Struct]:
    """Return the message, and where and how its number stands."""
    message: Any = type_()
    message.header.frame_id = quantity.sensor
    without = serialised(message)
    *path, last = quantity.field.split(".")
    owner = reduce(getattr, path, message)
    setattr(owner, last, 1.0)
    number = _NUMBERS[owner.get_fields_and_field_types()[last]]
    place = number_at(without, serialised(message), number.size)
    return Template.of(message), place, number


def decode_quantity(quantity: Quantity, message: Any) -> tuple[float, float]:
    """Return (t [s], value) of a sensor's message.

    Raises:
        MessageError: The value is not finite.
    """
    value = float(reduce(getattr, quantity.field.split("."), message))
    if not math.isfinite(value):
        raise MessageError(f"{quantity.name} must be finite, got {value} {quantity.unit}")
    return decode_stamp(message.header.stamp), value


def encode_tension(t: float, force: float) -> bytes:
    """Return the load cell's force [N] along the cable as a wrench's CDR bytes, stamped t [s]."""
    return encode_quantity(WrenchStamped, CABLE_TENSION, t, force)


def decode_tension(message: bytes | WrenchStamped) -> tuple[float, float]:
    """Return (t [s], force [N]) of a load cell's message or of its CDR bytes.

    Raises:
        MessageError: The force is not finite, or the bytes are none of its messages.
    """
    if not isinstance(message, bytes):
        return decode_quantity(CABLE_TENSION, message)
    try:
        reader = CdrReader(message)
        reader.skip(4, 2)
        reader.string()
        # The force along the cable is a wrench's first number.
        (force,) = _DOUBLE.unpack_from(message, reader.skip(8, 6))
    except CdrError:
        return decode_quantity(CABLE_TENSION, deserialised(message, WrenchStamped))
    if not math.isfinite(force):
        raise MessageError(f"tension must be finite, got {force} N")
    return serialised_stamp(message), force


def encode_clock(t: float) -> bytes:
    """Return simulated time t [s] as the CDR bytes of a Clock."""
    return bytes(_clock_template().stamped(t))


@cache
def _clock_template() -> Template:
    return Template.of(Clock())


def decode_clock(message: Clock) -> tuple[float, None]:
    """Return simulated time [s], and nothing beside it."""
    return decode_stamp(message.clock), None


@dataclass(frozen=True, kw_only=True, slots=True)
class JointStateLayout:
    """Where the numbers of two joints stand in the messages of one driver."""

    size: int  # Of a message [bytes].
    fixed: tuple[tuple[slice, bytes], ...]  # What does not change: names and counts.
    positions: tuple[int, int]  # Offsets of both positions.
    # Offsets of both velocities; None for joints without.
    velocities: tuple[int | None, int | None]
    guide: tuple[int, int] | None = None  # Offsets of the guide's x and y; None without them.

    @classmethod
    def of(cls, data: bytes, joints: tuple[str, str]) -> JointStateLayout:
        """Return the layout of a message that has both joints and their positions.

        Raises:
            CdrError: The bytes are of another representation.
            ValueError: A joint or its position is missing.
        """
        reader = CdrReader(data)
        reader.skip(4, 2)
        reader.string()
        # Between the fields there may be anything.
        begin = reader.skip(4, 0)
        spans, names = [(begin, begin + 4)], []
        for _ in range(reader.u32()):
            begin = reader.skip(4, 0)
            names.append(reader.string())
            spans.append((begin, reader.offset))
        count = reader.skip(4, 0)
        first, positions = reader.doubles()
        spans.append((count, count + 4))
        count = reader.skip(4, 0)
        second, velocities = reader.doubles()
        spans.append((count, count + 4))
        places = _places(names, joints)
        if max(places) >= positions:
            raise ValueError(f"{positions} positions of {len(names)} joints")
        cylinder, carriage, *across = (first + 8 * place for place in places)
        fast, slow = (second + 8 * k if k < velocities else None for k in places[:2])
        return cls(
            size=len(data),
            fixed=tuple((slice(begin, end), data[begin:end]) for begin, end in spans),
            positions=(cylinder, carriage),
            velocities=(fast, slow),
            guide=(across[0], across[1]) if across else None,
        )

    def fits(self, data: bytes) -> bool:
        """Return whether a message has this layout."""
        return len(data) == self.size and all(data[where] == what for where, what in self.fixed)

    def sample(self, data: bytes) -> JointSample:
        """Return both joints and the guide's place by a message of this layout."""
        at = _DOUBLE.unpack_from
        (cylinder, carriage), (fast, slow), guide = self.positions, self.velocities, self.guide
        place = None
        if guide is not None:
            place = GuidePlace(x=at(data, guide[0])[0], y=at(data, guide[1])[0])
        return JointSample(
            t=serialised_stamp(data),
            cylinder=at(data, cylinder)[0],
            carriage=at(data, carriage)[0],
            cylinder_speed=math.nan if fast is None else at(data, fast)[0],
            carriage_speed=math.nan if slow is None else at(data, slow)[0],
            guide=place,
        )
