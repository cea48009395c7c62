"""What a node does when it is triggered: it takes all that has arrived, topic by topic."""

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.subscription import Subscription
from rclpy.waitable import NumberOfEntities, Waitable

from winding_ros.topic import Delivered, Topic

# A wake-up costs as much as several messages: most topics are looked at this often [s].
LOOK_PERIOD = 0.01


@dataclass(frozen=True, kw_only=True)
class Input:
    """One of the topics that a node deals with."""

    topic: Topic  # Which.
    take: Callable[[Delivered], None]  # Gets each message, in CDR bytes.
    found: Callable[[int], None]  # Gets the number of messages that waited at each wake-up.
    triggers: bool  # Whether a message is taken at once; otherwise it waits for the next look.
    events: SubscriptionEventCallbacks  # Called when publishers do not match.


class Inputs:
    """Subscriptions of a node that are served together.

    An executor serves one topic after the other as they come: a node in arrears would see frames
    of a quarter of a second before the encoder samples of the first of them.

    Args:
        node: Whose subscriptions.
        inputs: In the order in which they are dealt with.
    """

    def __init__(self, node: Node, inputs: Sequence[Input]) -> None:
        self._node = node
        # A camera's thread may look, too: each topic is taken from by one thread at a time.
        self._taking = threading.Lock()
        self._served = [(item, self._subscription(item)) for item in inputs]
        self._alarms = [
            _Alarm(node, subscription, self.serve)
            for item, subscription in self._served
            if item.triggers
        ]
        for alarm in self._alarms:
            node.add_waitable(alarm)
        # Wall time: simulated time may stand while messages wait.
        self._timer = node.create_timer(
            LOOK_PERIOD, self.serve, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def destroy(self) -> None:
        """Take nothing any more."""
        self._node.destroy_timer(self._timer)
        for alarm in self._alarms:
            self._node.remove_waitable(alarm)
        for _, subscription in self._served:
            subscription.destroy()
        self._served = []

    def _subscription(self, item: Input) -> Subscription:
        subscription = item.topic.listen(self._node, _never, raw=True, events=item.events)
        # The executor takes from what the node lists, and does not report when a message was sent;
        # rclpy has no other way to leave a subscription out of that.
        self._node._subscriptions.remove(subscription)
        return subscription

    def serve(self) -> None:
        """Deal with everything that has arrived."""
        with self._taking:
            self._serve()

    def _serve(self) -> None:
        awake = time.time_ns()
        for item, subscription in self._served:
            count = 0
            for waiting in item.topic.waiting(subscription, raw=True):
                item.take(waiting)
                # What goes on arriving has its turn later: a slow topic must not starve a fast one.
                if waiting.arrived_ns > awake:
                    break
                count += 1
            if count:
                item.found(count)


class _Alarm(Waitable):  # type: ignore[misc]
    """Has the executor wake a node up when a message has arrived, and leaves it to the node."""

    def __init__(self, node: Node, subscription: Subscription, wake: Callable[[], None]) -> None:
        super().__init__(node.default_callback_group)
        self._subscription = subscription
        self._wake = wake
        self._index = 0

    def is_ready(self, wait_set: Any) -> bool:
        return bool(wait_set.is_ready("subscription", self._index))

    def take_data(self) -> None:
        """The node takes its messages in an order of its own."""

    async def execute(self, taken_data: None) -> None:
        self._wake()

    def get_num_entities(self) -> NumberOfEntities:
        return NumberOfEntities(1, 0, 0, 0, 0)

    def add_to_wait_set(self, wait_set: Any) -> None:
        with self._subscription.handle:
            self._index = wait_set.add_subscription(self._subscription.handle)


def _never(message: bytes) -> None:
    raise RuntimeError("the executor took a message that the node itself takes")
