"""Who else publishes on a topic of the graph, or gives signs of life in a node's name?"""

from __future__ import annotations

from collections.abc import Iterable

from rclpy.node import Node

from winding_ros import topics
from winding_ros.message_guard import Rivals
from winding_ros.runtime.endpoints import contestants
from winding_ros.runtime.heartbeat import heartbeat_topic


class RivalWatch:
    """Counts the publishers of every topic that may have one.

    Args:
        node: Knows the graph.
        nodes: Names of the nodes that give signs of life.
    """

    def __init__(self, node: Node, nodes: Iterable[str]) -> None:
        self._node = node
        # A robot_state_publisher says the same as the orchestrator.
        shared = (topics.EVERY_NODE, topics.ORCHESTRATOR)
        own = [topic.name for topic in topics.TOPICS if topic.publisher not in shared]
        signs = [heartbeat_topic(name) for name in (*nodes, topics.ORCHESTRATOR)]
        self._rivals = {name: Rivals() for name in (*own, *signs)}

    def look(self, now: float) -> str:
        """Return what is contested at monotonic wall time `now` [s], as a sentence, or nothing."""
        for name, before in self._rivals.items():
            self._rivals[name] = after = before.look(name, contestants(self._node, name), now)
            if after.sentence:
                return after.sentence
        return ""
