"""Signs of life: every process publishes that it lives, and DDS reports when it no longer does.

A process that is stopped or gone loses its liveliness within LEASE, whatever its interpreter was
doing. One whose callbacks no longer come to an end misses its deadline, STALL.

Liveliness is offered only by who is watched for it. Fast DDS 2.14 asserts it in a thread of its
own, under locks that the removal of endpoints takes as well: a publisher that is destroyed
meanwhile, with the interpreter's lock held, may wait for ever. The orchestrator, which closes its
publishers while the nodes leave, offers none: the machine's dead-man hears its messages.
"""

import time
from collections.abc import Callable
from enum import Enum
from typing import Any

from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from std_msgs.msg import Header

from winding_ros.messages.stamps import encode_stamp

PERIOD = 0.1
LEASE = 0.8
STALL = 3.0


class Sign(Enum):
    """What DDS reports of a process."""

    ALIVE = "lives"
    STOPPED = "has stopped"
    REPLACED = "was started again"
    STALLED = "no longer finishes its work"


def heartbeat_topic(node: str) -> str:
    """Return the topic of a node's signs of life, relative to the graph's namespace."""
    return f"{node}/heartbeat"


def _qos(*, watched: bool) -> QoSProfile:
    profile = QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=1,
        reliability=ReliabilityPolicy.RELIABLE,
        deadline=Duration(seconds=STALL),
    )
    if watched:
        profile.liveliness = LivelinessPolicy.AUTOMATIC
        profile.liveliness_lease_duration = Duration(seconds=LEASE)
    return profile


class Heartbeat:
    """Publishes signs of life of a node, at most one each PERIOD however often it is asked.

    Args:
        node: Whose life.
        name: Node name in the topic.
        clock: Monotonic wall time [s].
        watched: Whether `watch_heartbeat` may follow it; `hear_heartbeat` always may.
    """

    def __init__(
        self,
        node: Node,
        name: str,
        clock: Callable[[], float] = time.monotonic,
        *,
        watched: bool = True,
    ) -> None:
        self._clock = clock
        self._next = -1.0
        self._publisher = node.create_publisher(
            Header, heartbeat_topic(name), _qos(watched=watched)
        )

    def beat(self) -> None:
        """Say that the node lives and finishes its work."""
        now = self._clock()
        if now < self._next:
            return
        self._next = now + PERIOD
        self._publisher.publish(Header(stamp=encode_stamp(now)))


def hear_heartbeat(node: Node, name: str, heard: Callable[[], None]) -> Subscription:
    """Return a subscription that calls `heard` at each sign of life of a node."""
    return node.create_subscription(
        Header, heartbeat_topic(name), lambda _message: heard(), _qos(watched=False)
    )


def watch_heartbeat(node: Node, name: str, notify: Callable[[Sign], None]) -> Subscription:
    """Return a subscription that reports a node's signs of life and their end.

    Args:
        node: Who watches.
        name: Name of the watched node.
        notify: Called by the executor of `node` with ALIVE at each sign of life, with STOPPED once
            and with STALLED again each STALL when they end, with REPLACED when one process has
            ended and another of that name lives.
    """

    def on_liveliness(event: Any) -> None:
        if event.alive_count_change < 0:
            notify(Sign.STOPPED if event.alive_count == 0 else Sign.REPLACED)

    return node.create_subscription(
        Header,
        heartbeat_topic(name),
        lambda _message: notify(Sign.ALIVE),
        _qos(watched=True),
        event_callbacks=SubscriptionEventCallbacks(
            deadline=lambda _event: notify(Sign.STALLED), liveliness=on_liveliness
        ),
    )
