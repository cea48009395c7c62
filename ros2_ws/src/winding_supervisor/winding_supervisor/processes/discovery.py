"""Endpoints of the graph: has every publisher its subscribers, has a topic a second publisher?"""

import asyncio
import time
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from winding_ros import topics
from winding_ros.client.async_client import AsyncClient
from winding_ros.graph import GraphError, NodeSpec, expected_subscribers
from winding_ros.message_guard import UNKNOWN_NODE, Rivals
from winding_ros.runtime.endpoints import contestants
from winding_ros.runtime.heartbeat import heartbeat_topic
from winding_ros.topic import Topic

PATIENCE = 30.0
# An external subscriber that cannot be reached is not waited for any longer.
_EXTERNAL_PATIENCE = 5.0
_POLL = 0.02


@dataclass(eq=False)
class Discovery:
    """Compares the subscriber counts of publishers with what the graph promises.

    A publisher knows how many subscribers it has, not who they are. Those from outside the
    graph, such as an operator's page, are counted out: they must not stand for a node that is
    missing still.
    """

    client: AsyncClient  # Knows the counts that nodes report, and who subscribes
    recorded: frozenset[str]  # Topics that the recorder listens to
    graph: tuple[NodeSpec, ...]  # The nodes

    def __post_init__(self) -> None:
        self._nodes = frozenset(spec.name for spec in self.graph)

    async def complete(self, down: Callable[[], Collection[str]] = frozenset) -> None:
        """Wait until no subscriber is missing.

        Args:
            down: Returns which nodes are down now; they are not waited for.

        Raises:
            GraphError: Who is missing, as a sentence.
        """
        begin = time.monotonic()
        while missing := self.missing(
            external=time.monotonic() - begin < _EXTERNAL_PATIENCE, down=down()
        ):
            if time.monotonic() - begin > PATIENCE:
                raise GraphError(
                    f"not every subscriber found its publisher in {PATIENCE:g} s: {missing[0]}"
                )
            await asyncio.sleep(_POLL)

    def missing(self, *, external: bool = True, down: Collection[str] = ()) -> list[str]:
        """Return one sentence for each publisher that lacks subscribers.

        Args:
            external: Whether those from outside the graph are counted out.
            down: Nodes that neither publish nor subscribe now.
        """
        found = []
        up = tuple(spec for spec in self.graph if spec.name not in down)
        for node, counts in expected_subscribers(self.recorded, up).items():
            for topic, count in counts.items():
                matched = self.client.matched(node, topic)
                if matched < count or (external and matched < count + self._outsiders(topic)):
                    found.append(f"{node} {topic} has {matched} of {count} subscribers")
        return found

    def _outsiders(self, name: str) -> int:
        topic = next(topic for topic in topics.TOPICS if topic.name == name)
        # A recorder that takes pictures on demand comes and goes, too.
        own = self._nodes | {topics.RECORDER} if name in self.recorded else self._nodes
        return outsiders(self.client, topic, own)


def outsiders(client: AsyncClient, topic: Topic, own: Collection[str]) -> int:
    """Return how many subscribers a topic's publisher can have beside those of its own graph."""
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


class RivalWatch:
    """Counts the publishers of every topic that may have one.

    Args:
        node: Knows the graph.
        nodes: Names of the nodes that give signs of life.
    """

    def __init__(self, node: Node, nodes: Iterable[str]) -> None:
        self._node = node
        # A robot_state_publisher publishes the same as the orchestrator.
        shared = (topics.EVERY_NODE, topics.ORCHESTRATOR)
        own = [topic.name for topic in topics.TOPICS if topic.publisher not in shared]
        signs = [heartbeat_topic(name) for name in (*nodes, topics.ORCHESTRATOR)]
        self._rivals = {name: Rivals() for name in (*own, *signs)}

    def look(self, now: float) -> tuple[str, str] | None:
        """Return which topic is contested at monotonic time `now` [s], and by whom, or None."""
        for name, before in self._rivals.items():
            self._rivals[name] = after = before.look(name, contestants(self._node, name), now)
            if after.text:
                return name, after.text
        return None
