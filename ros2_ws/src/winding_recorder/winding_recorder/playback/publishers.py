"""Publishers of a playback: alone on their topics, found by who listens, and heard to the end."""

import time
from collections.abc import Collection, Iterable

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher

from winding_recorder.bags.description import BagError
from winding_ros.message_guard import UNKNOWN_NODE

# Subscribers that are there find a new publisher in up to 0.6 s on a busy machine.
_MATCH_PATIENCE = 2.0
_DISCOVERY = 1.0
# A page looks at the newest message ten times a second, and later when the computer is busy.
_LINGER = 0.5
_LOOK_PERIOD = 0.05


def refuse_rivals(node: Node, names: Iterable[str]) -> None:
    """Refuse topics that others publish.

    Raises:
        BagError: Another node publishes one.
    """
    # Publishers that are there already need a moment to be seen, and their nodes a little longer.
    end, last = time.monotonic() + _DISCOVERY, False
    while not last:
        last = time.monotonic() >= end
        for name in names:
            rivals = node.get_publishers_info_by_topic(name)
            if rivals and (last or rivals[0].node_name != UNKNOWN_NODE):
                raise BagError(
                    f"{name} is published by {rivals[0].node_name} already; stop it, choose "
                    "another --domain, or --force to publish beside it"
                )
        time.sleep(_LOOK_PERIOD)


def wait_for_subscribers(node: Node, publishers: Collection[Publisher]) -> None:
    """Wait until every subscriber that the graph knows has found its publisher.

    Subscribers of other processes need a moment to be known: without any, the wait is for
    the whole patience.
    """
    end = time.monotonic() + _MATCH_PATIENCE
    while time.monotonic() < end:
        counts = [
            (publisher.get_subscription_count(), node.count_subscribers(publisher.topic_name))
            for publisher in publishers
        ]
        known = sum(subscribers for _, subscribers in counts)
        if known and all(matched >= subscribers for matched, subscribers in counts):
            return
        time.sleep(_LOOK_PERIOD)


def drain(publishers: Iterable[Publisher]) -> None:
    """Wait until subscribers have everything, for a limited time.

    Reliable ones acknowledge it; others look now and then for what was the last.
    """
    patience = Duration(seconds=_MATCH_PATIENCE)
    for publisher in publishers:
        publisher.wait_for_all_acked(patience)
    time.sleep(_LINGER)
