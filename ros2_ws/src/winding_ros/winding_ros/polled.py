"""A subscription that is asked, not called: serialised messages with their numbers."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import NamedTuple

from rclpy.node import Node
from rclpy.qos_overriding_options import QoSOverridingOptions

from winding_ros.topic import Topic


class Taken(NamedTuple):
    """A message as DDS delivered it.

    Attributes:
        data: CDR bytes.
        number: DDS counts a publisher's messages 1, 2, 3 and so on.
        sent_ns: When its publisher sent it, on this host's monotonic clock [ns].
        received_ns: When it arrived, on the same clock, however late it was taken [ns].
    """

    data: bytes
    number: int
    sent_ns: int
    received_ns: int


class PolledTopic:
    """Takes what has arrived on a topic when it is asked to.

    The node must not be spun. An events executor of rclpy 7.1 cannot hand over the number that
    a publisher gave a message (it fails with SystemError), and one wake-up per message costs
    more than a look every few milliseconds.
    """

    def __init__(self, node: Node, topic: Topic) -> None:
        self.topic = topic
        self._node = node
        self._subscription = node.create_subscription(
            topic.type,
            topic.name,
            self._called,
            topic.qos,
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
            raw=True,
        )

    def take(self) -> Iterator[Taken]:
        """Yield at most `depth` messages that wait."""
        # DDS stamps by the system's clock, which may be set; only the age of a stamp is used.
        offset = time.monotonic_ns() - time.time_ns()
        kind, handle = self.topic.type, self._subscription.handle
        with handle:
            for _ in range(self.topic.depth):
                taken = handle.take_message(kind, True)
                if taken is None:
                    return
                data, information = taken
                yield Taken(
                    data,
                    information["publication_sequence_number"],
                    information["source_timestamp"] + offset,
                    information["received_timestamp"] + offset,
                )

    def close(self) -> None:
        """Take nothing any more."""
        self._node.destroy_subscription(self._subscription)

    def _called(self, message: bytes) -> None:
        raise RuntimeError(f"the node of the polled topic {self.topic.name} is spun")
