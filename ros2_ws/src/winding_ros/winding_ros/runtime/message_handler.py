"""A node's work as messages in and messages out, with no node around it.

A node subscribes and publishes; what it answers to a message is its handler's business. So a
recorded run can be put to the same code again, without DDS, threads or a clock.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

from winding_ros.messages.cdr import serialised
from winding_ros.topic import Topic


@dataclass(frozen=True, kw_only=True)
class Answer:
    """A message to publish on a topic, as an object or as CDR bytes."""

    topic: Topic
    message: Any
    # Stamp of the frame that it is about, and the instant on the machine's clock that this shows
    # [s], where the frame's stamp is known to be another; for the trace.
    shown: tuple[float, float] | None = None

    @property
    def data(self) -> bytes:
        """The message as it is sent."""
        return serialised(self.message)


class MessageHandler(Protocol):
    """The work of one node from activation on; the graph states its inputs and outputs."""

    def begin(self, t: float) -> Iterator[Answer]:
        """Begin a new run at a time [s]; yield what is published at once."""

    def take(self, topic: Topic, data: bytes) -> Iterator[Answer]:
        """Take the CDR bytes of a message; yield the answers to it.

        Raises:
            MessageError: The message cannot be used.
        """
