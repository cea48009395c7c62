"""Messages of the graph out of the bytes that DDS, a buffer or a recording holds."""

from typing import Any

from rclpy.serialization import deserialize_message


class MessageError(ValueError):
    """A message is not what its topic declares."""


def deserialised(data: bytes, type_: type) -> Any:
    """Return a message of a type from its CDR bytes.

    Raises:
        MessageError: The bytes are no such message.
    """
    try:
        return deserialize_message(data, type_)
    except Exception as error:
        # What the type support raises is private to rclpy.
        name = type_.__module__.split(".")[0]
        raise MessageError(f"{len(data)} bytes are not a {name}/{type_.__name__}") from error
