"""What a node does when it wakes up: everything that has arrived, topic by topic in one order."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.subscription import Subscription

from winding_ros.topic import Topic

# A wake-up costs as much as several messages: most topics are looked at this often [s].
LOOK_PERIOD = 0.01


@dataclass(frozen=True, kw_only=True)
class Input:
    """One of the topics that a node deals with.

    Attributes:
        topic: Which.
        take: Gets the CDR bytes of each message.
        found: Told how many messages waited at each wake-up.
        wakes: Whether a message wakes the node up; otherwise it waits for the next look.
        events: Called when publishers do not match.
    """

    topic: Topic
    take: Callable[[bytes], None]
    found: Callable[[int], None]
    wakes: bool
    events: SubscriptionEventCallbacks


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
        self._served = [(item, self._subscription(item)) for item in inputs]
        # Wall time: simulated time may stand while messages wait.
        self._timer = node.create_timer(
            LOOK_PERIOD, self._serve, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def destroy(self) -> None:
        """Take nothing any more."""
        self._node.destroy_timer(self._timer)
        for _, subscription in self._served:
            if not self._node.destroy_subscription(subscription):
                subscription.destroy()
        self._served = []

    def _subscription(self, item: Input) -> Subscription:
        woken = partial(self._serve, item)
        subscription = item.topic.listen(self._node, woken, raw=True, events=item.events)
        if not item.wakes:
            # The executor waits for what the node lists, and rclpy has no other way to leave a
            # subscription out of that.
            self._node._subscriptions.remove(subscription)
        return subscription

    def _serve(self, woken: Input | None = None, message: bytes = b"") -> None:
        awake = time.time_ns()
        for item, subscription in self._served:
            count = 0
            if item is woken:
                item.take(message)
                count = 1
            for waiting, arrived in item.topic.waiting(subscription, raw=True):
                item.take(waiting)
                # What goes on arriving has its turn later: a slow topic must not starve a fast one.
                if arrived > awake:
                    break
                count += 1
            if count:
                item.found(count)
