"""What a node does when it wakes up: everything that has arrived, topic by topic in one order."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rclpy.subscription import Subscription

from winding_ros.topic import Topic


@dataclass(frozen=True, kw_only=True)
class Queue:
    """One of the topics that a node deals with.

    Attributes:
        topic: Which.
        take: Gets each message.
        found: Told how many messages waited at each wake-up.
    """

    topic: Topic
    take: Callable[[Any], None]
    found: Callable[[int], None]


def in_order(
    own: Topic, queues: Sequence[Queue], subscriptions: Mapping[Topic, Subscription]
) -> Callable[[Any], None]:
    """Return the callback of one topic's subscription.

    Args:
        own: The topic whose message wakes the node up.
        queues: All topics, in the order in which they are dealt with.
        subscriptions: Of all these topics, by the time when the first message comes.
    """

    def serve(message: Any) -> None:
        awake = time.time_ns()
        for queue in queues:
            count = 0
            if queue.topic is own:
                queue.take(message)
                count = 1
            for waiting, arrived in queue.topic.waiting(subscriptions[queue.topic]):
                queue.take(waiting)
                # What goes on arriving has its turn later: a slow topic must not starve a fast one.
                if arrived > awake:
                    break
                count += 1
            queue.found(count)

    return serve
