"""Has every publisher of the graph found the subscribers that the graph promises?"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Collection

from rclpy.qos import DurabilityPolicy, QoSProfile

from winding_ros import topics
from winding_ros.client.async_client import AsyncClient
from winding_ros.graph import NodeSpec, expected_subscribers
from winding_ros.message_guard import UNKNOWN_NODE
from winding_ros.topic import Topic

PATIENCE = 30.0
# A stranger that cannot be reached is not waited for any longer.
_STRANGER_PATIENCE = 5.0
_POLL = 0.02


class Discovery:
    """Compares what publishers say of their subscribers with what the graph promises.

    A publisher knows how many subscribers it has, not who they are. Those from outside the
    graph, such as an operator's page, are counted out: they must not stand for a node that is
    missing still.

    Args:
        client: Knows what the nodes say, and who subscribes.
        recorded: Topics that the recorder listens to.
        graph: The nodes.
    """

    def __init__(
        self, client: AsyncClient, recorded: frozenset[str], graph: tuple[NodeSpec, ...]
    ) -> None:
        self._client = client
        self._recorded = recorded
        self._expected = expected_subscribers(recorded, graph)
        self._nodes = frozenset(spec.name for spec in graph)

    async def complete(self) -> None:
        """Wait until nobody is missing.

        Raises:
            TimeoutError: Who is missing, as a sentence.
        """
        begin = time.monotonic()
        while missing := self.missing(strangers=time.monotonic() - begin < _STRANGER_PATIENCE):
            if time.monotonic() - begin > PATIENCE:
                raise TimeoutError(
                    f"not every subscriber found its publisher in {PATIENCE:g} s: {missing[0]}"
                )
            await asyncio.sleep(_POLL)

    def missing(self, *, strangers: bool = True) -> list[str]:
        """Return one sentence for each publisher that lacks subscribers.

        Args:
            strangers: Whether those from outside the graph are counted out.
        """
        found = []
        for node, counts in self._expected.items():
            for topic, count in counts.items():
                matched = self._client.matched(node, topic)
                if matched < count or (strangers and matched < count + self._outsiders(topic)):
                    found.append(f"{node} {topic} has {matched} of {count} subscribers")
        return found

    def _outsiders(self, name: str) -> int:
        topic = next(topic for topic in topics.TOPICS if topic.name == name)
        # A recorder that takes pictures on demand comes and goes, too.
        own = self._nodes | {topics.RECORDER} if name in self._recorded else self._nodes
        return outsiders(self._client, topic, own)


def outsiders(client: AsyncClient, topic: Topic, own: Collection[str]) -> int:
    """Return how many subscribers a topic's publisher can have beside those of its own graph.

    Args:
        client: Knows who subscribes.
        topic: Of the graph.
        own: Names of the graph's nodes that may subscribe.
    """
    node = client.node
    namespace = node.get_namespace().rstrip("/")
    return sum(
        found.node_name != UNKNOWN_NODE
        and (found.node_namespace.rstrip("/") != namespace or found.node_name not in own)
        and _reaches(topic, found.qos_profile)
        for found in node.get_subscriptions_info_by_topic(node.resolve_topic_name(topic.name))
    )


def _reaches(topic: Topic, subscriber: QoSProfile) -> bool:
    """Return whether a subscriber can match a topic's publisher, which is reliable.

    The graph reports a deadline of eternity as one that the publisher does not keep, so rclpy's
    own comparison is of no use here.
    """
    return topic.latched or subscriber.durability != DurabilityPolicy.TRANSIENT_LOCAL
