"""Made-up messages of the machine: a reading, or a MessageError and nothing else."""

import math

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from hypothesis import given
from hypothesis import strategies as st
from made_up import any_float, fuzzed, number, stamps, taken, wired
from sensor_msgs.msg import JointState

from winding_core.machine.readings import AxisReading
from winding_ros.message_guard import StampError
from winding_ros.messages.rig import (
    decode_joint_state,
    decode_tension,
    encode_joint_state,
    encode_tension,
)
from winding_ros.messages.stamps import decode_stamp, encode_stamp, serialised_stamp_ns

pytestmark = pytest.mark.slow


@fuzzed
@given(
    names=st.lists(st.sampled_from(["cylinder_joint", "carriage_joint", "", "x"]), max_size=4),
    position=st.lists(any_float, max_size=4),
    velocity=st.lists(any_float, max_size=4),
)
def test_joint_states(names: list[str], position: list[float], velocity: list[float]) -> None:
    read = taken(decode_joint_state, JointState(name=names, position=position, velocity=velocity))
    if read is not None:
        _, reading = read
        assert np.isfinite(list(vars(reading).values())).all()
        assert reading.cylinder_angle == position[names.index("cylinder_joint")]
        assert reading.feed_speed == velocity[names.index("carriage_joint")]


@fuzzed
@given(t=stamps, values=st.tuples(number, number, number, number))
def test_joint_states_come_back(t: float, values: tuple[float, ...]) -> None:
    reading = AxisReading(
        cylinder_angle=values[0],
        angular_speed=values[1],
        carriage_position=values[2],
        feed_speed=values[3],
    )
    assert decode_joint_state(wired(encode_joint_state(t, reading), JointState)) == (t, reading)


@fuzzed
@given(t=stamps, force=any_float)
def test_tension(t: float, force: float) -> None:
    data = encode_tension(t, force)
    for message in (data, wired(data, WrenchStamped)):
        read = taken(decode_tension, message)
        assert read == ((t, force) if math.isfinite(force) else None)


@fuzzed
@given(data=st.binary(max_size=40))
def test_stamps_of_any_bytes(data: bytes) -> None:
    if len(data) < 12:
        with pytest.raises(StampError, match="at least 12 bytes"):
            serialised_stamp_ns(data)
    else:
        stamp = serialised_stamp_ns(data)
        assert -(2**31) * 10**9 <= stamp < 2**31 * 10**9 + 2**32


@fuzzed
@given(nanoseconds=st.integers(-(2**52), 2**52))
def test_stamps_come_back(nanoseconds: int) -> None:
    data = encode_tension(nanoseconds * 1e-9, 0.0)
    assert serialised_stamp_ns(data) == pytest.approx(nanoseconds, abs=1)
    message = wired(data, WrenchStamped)
    again = encode_stamp(decode_stamp(message.header.stamp))
    assert (
        abs(again.nanosec - message.header.stamp.nanosec) <= 1
        or again.sec != message.header.stamp.sec
    )
