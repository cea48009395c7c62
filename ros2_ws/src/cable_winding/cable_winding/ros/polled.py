"""A subscription that is asked, not called: serialised messages with their numbers."""

from __future__ import annotations

from collections.abc import Iterator

from rclpy.node import Node
from rclpy.qos_overriding_options import QoSOverridingOptions

from cable_winding.ros.topics import Topic


class PolledTopic:
    """Takes what has arrived on a topic when it is asked to.

    The node must not be spun. An events executor of rclpy 7.1 cannot hand over the number that
    a publisher gave a message (it fails with SystemError), and one wake-up per message costs
    more than a look every few milliseconds.
    """

    def __init__(self, node: Node, topic: Topic) -> None:
        self.topic = topic
        self._subscription = node.create_subscription(
            topic.type,
            topic.name,
            self._called,
            topic.qos,
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
            raw=True,
        )

    def take(self) -> Iterator[tuple[bytes, int]]:
        """Yield (CDR bytes, publication number) of at most `depth` messages that wait.

        DDS counts a publisher's messages 1, 2, 3 and so on.
        """
        for _ in range(self.topic.depth):
            with self._subscription.handle:
                taken = self._subscription.handle.take_message(self.topic.type, True)
            if taken is None:
                return
            data, information = taken
            yield data, information["publication_sequence_number"]

    def _called(self, message: bytes) -> None:
        raise RuntimeError(f"the node of the polled topic {self.topic.name} is spun")
