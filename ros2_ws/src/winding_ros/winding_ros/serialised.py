"""Messages of the graph out of the bytes that a buffer or a recording kept."""

from __future__ import annotations

from typing import Any

from rclpy.serialization import deserialize_message

from winding_ros.rig_messages import MessageError
from winding_ros.topic import Topic


def deserialised(data: bytes, topic: Topic) -> Any:
    """Return a topic's message from its CDR bytes.

    Raises:
        MessageError: The bytes are no message of the topic's type.
    """
    try:
        return deserialize_message(data, topic.type)
    except Exception as error:
        # What the type support raises is private to rclpy.
        raise MessageError(f"{len(data)} bytes are not a {topic.type_name}") from error
