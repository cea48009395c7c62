"""Messages whose bytes were changed on their way: decoded, or refused with a MessageError."""

from collections.abc import Callable
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import WrenchStamped
from hypothesis import given
from hypothesis import strategies as st
from made_up import fuzzed, taken
from rclpy.serialization import serialize_message
from sensor_msgs.msg import PointField

from winding_core.machine.axes import MachineAxes
from winding_core.markers import MARKER_DTYPE
from winding_ros import topics
from winding_ros.messages.camera import (
    decode_image,
)
from winding_ros.messages.cdr import serialised
from winding_ros.messages.clouds import (
    decode_cloud,
)
from winding_ros.messages.diagnostics import NAME
from winding_ros.messages.rig import (
    JointStateReader,
    decode_tension,
)
from winding_ros.messages.serialised import deserialised
from winding_ros.topic import Topic

pytestmark = pytest.mark.slow


def example(topic: Topic) -> Any:
    """Return a message of a topic with something in every list."""
    message = topic.type()
    for name, kind in topic.type.get_fields_and_field_types().items():
        if kind == "sequence<string>":
            setattr(message, name, ["cylinder_joint", "carriage_joint"])
        elif kind == "sequence<double>":
            setattr(message, name, [0.5, 1.5])
        elif kind.startswith("sequence<diagnostic_msgs/DiagnosticStatus"):
            message.status = [
                DiagnosticStatus(name=NAME, values=[KeyValue(key="case 1", value="1")])
            ]
        elif kind.startswith("sequence<sensor_msgs/PointField"):
            message.fields = [PointField(name="x", offset=0, datatype=7, count=1)]
    if isinstance(message, WrenchStamped):
        message.wrench.force.x = 1.0
    return message


def known_layout(data: bytes) -> Any:
    """Read joint states like a subscriber that has learnt the layout of its driver."""
    read = JointStateReader(MachineAxes())
    read(serialised(example(topics.JOINT_STATES)))
    return read(data)


BYTE_DECODERS: dict[Topic, tuple[Callable[[bytes], Any], ...]] = {
    topics.JOINT_STATES: (JointStateReader(MachineAxes()), known_layout),
    topics.TENSION: (decode_tension,),
    topics.IMAGE: (decode_image,),
    topics.TRACKED_MARKERS: (lambda data: decode_cloud(data, MARKER_DTYPE),),
}


@pytest.mark.parametrize("topic", topics.TOPICS, ids=lambda topic: topic.name)
@fuzzed
@given(
    changes=st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 255)), max_size=6),
    length=st.one_of(st.just(1.0), st.floats(0, 1)),
    garbage=st.one_of(st.none(), st.binary(max_size=120)),
)
def test_changed_bytes_of_a_message(
    topic: Topic,
    changes: list[tuple[float, int]],
    length: float,
    garbage: bytes | None,
) -> None:
    whole = serialize_message(example(topic)) if garbage is None else garbage
    content = bytearray(whole[: round(length * len(whole))])
    for place, value in changes if content else []:
        content[int(place * len(content))] = value
    data = bytes(content)
    taken(lambda data: topic.decode(deserialised(data, topic.type)), data)
    for decode in BYTE_DECODERS.get(topic, ()):
        taken(decode, data)
