"""One topic of the graph: its declaration, and how a node publishes, subscribes or polls it."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription

from winding_core.machine.readings import Quantity


class Delivered(NamedTuple):
    """A message as DDS delivered it."""

    data: Any  # The message, or its CDR bytes.
    number: int  # DDS counts a publisher's messages 1, 2, 3 and so on.
    sent_ns: int  # When its publisher sent it, by the clock of that system [ns].
    arrived_ns: int  # When it arrived, by the clock of this system, however late it was taken [ns].


# Each is declared once: to compare all their fields would cost as much as to deal with a message.
@dataclass(frozen=True, kw_only=True, eq=False)
class Topic:
    """One topic of the graph contract; equal to itself alone."""

    name: str  # Relative to the graph's namespace, or absolute.
    type: type  # Message class.
    rate: float | None  # Nominal messages per simulated second; None for topics sent on change.
    # Name of the node that publishes it; EVERY_NODE for shared topics, COMMANDER for those that
    # come from outside the graph, or not at all.
    publisher: str
    depth: int  # History kept for a slow reader.
    latched: bool = False  # Whether late subscribers get the last message.
    recorded: bool = True  # Whether the recorder stores it.
    # Whether its stamps show how far its publisher has come; they hold simulated time.
    answer: bool = False
    description: str  # One line for the interface table.
    # Makes (t [s], content) of a message; raises MessageError.
    decode: Callable[[Any], tuple[float, Any]]
    quantity: Quantity | None = None  # What its one number measures; None for other topics.

    @property
    def type_name(self) -> str:
        """Full ROS name of the message type, as bags write it."""
        package, kind, *_ = self.type.__module__.split(".")
        return f"{package}/{kind}/{self.type.__name__}"

    @property
    def qos(self) -> QoSProfile:
        """Reliable, keep last `depth`, transient local when latched."""
        durability = DurabilityPolicy.TRANSIENT_LOCAL if self.latched else DurabilityPolicy.VOLATILE
        return QoSProfile(
            history=HistoryPolicy.KEEP_LAST,
            depth=self.depth,
            reliability=ReliabilityPolicy.RELIABLE,
            durability=durability,
        )

    def subscribe(
        self,
        node: Node,
        callback: Callable[[Any], None],
        *,
        raw: bool = False,
        events: SubscriptionEventCallbacks | None = None,
        found: Callable[[int], None] | None = None,
    ) -> Subscription:
        """Return a subscription on a node; raw callbacks get the serialised bytes.

        `found` is called with the number of messages that waited at each wake-up.

        One wake-up serves every message that waits. An executor by itself takes one message of
        each topic per round: a reader in arrears would see a 1 kHz topic fall ever further
        behind a 200 Hz one.
        """

        def serve(message: Any) -> None:
            awake = time.time_ns()
            callback(message)
            count = 1
            for waiting in self.waiting(subscription, raw=raw):
                callback(waiting.data)
                # What arrives while others are served did not wait for the node to wake up.
                count += waiting.arrived_ns <= awake
            if found is not None:
                found(count)

        subscription = self.listen(node, serve, raw=raw, events=events)
        return subscription

    def listen(
        self,
        node: Node,
        callback: Callable[[Any], None],
        *,
        raw: bool = False,
        events: SubscriptionEventCallbacks | None = None,
    ) -> Subscription:
        """Return a plain subscription, whose callback gets one message at a time."""
        subscription: Subscription = node.create_subscription(
            self.type,
            self.name,
            callback,
            self.qos,
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
            raw=raw,
            event_callbacks=events,
        )
        return subscription

    def waiting(self, subscription: Subscription, *, raw: bool = False) -> Iterator[Delivered]:
        """Take the messages that have arrived on a subscription of this topic, `depth` at most."""
        for _ in range(self.depth):
            with subscription.handle:
                taken = subscription.handle.take_message(self.type, raw)
            if taken is None:
                return
            message, information = taken
            yield Delivered(
                message,
                information["publication_sequence_number"],
                information["source_timestamp"],
                information["received_timestamp"],
            )

    def advertise(self, node: Node) -> Publisher:
        """Return a plain publisher on a node that is not managed."""
        return node.create_publisher(
            self.type,
            self.name,
            self.qos,
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
        )


class Taken(NamedTuple):
    """A message in CDR bytes, with its times by the monotonic clock of this host too."""

    data: bytes  # CDR bytes.
    number: int  # DDS counts a publisher's messages 1, 2, 3 and so on.
    sent_ns: int  # When its publisher sent it, on this host's monotonic clock [ns].
    received_ns: int  # When it arrived, on the same clock, however late it was taken [ns].
    published_at_ns: int  # When it was sent, by the clock of its publisher's system [ns].
    arrived_at_ns: int  # When it arrived, by the clock of this system [ns].


class PolledTopic:
    """Takes what has arrived on a topic when it is asked to.

    The node must not be spun. An events executor of rclpy 7.1 cannot hand over the number that
    a publisher gave a message (it fails with SystemError), and one wake-up per message costs
    more than a look every few milliseconds.
    """

    def __init__(self, node: Node, topic: Topic) -> None:
        self.topic = topic
        self._node = node
        self._subscription = topic.listen(node, self._called, raw=True)

    def take(self) -> Iterator[Taken]:
        """Yield at most `depth` messages that wait."""
        # DDS stamps by the system's clock, which may be set; only the age of a stamp is used.
        offset = time.monotonic_ns() - time.time_ns()
        for data, number, sent, arrived in self.topic.waiting(self._subscription, raw=True):
            yield Taken(data, number, sent + offset, arrived + offset, sent, arrived)

    def close(self) -> None:
        """Take nothing any more."""
        self._node.destroy_subscription(self._subscription)

    def _called(self, message: bytes) -> None:
        raise RuntimeError(f"the node of the polled topic {self.topic.name} is spun")
