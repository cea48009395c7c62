"""Who else publishes on a topic of the graph, or gives signs of life in a node's name?"""

from __future__ import annotations

from collections.abc import Iterable

from rclpy.node import Node

from winding_ros import topics
from winding_ros.heartbeat import heartbeat_topic
from winding_ros.message_guard import Rivals


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
            publishers: tuple[tuple[str, str], ...] = ()
            if self._node.count_publishers(name) > 1:
                publishers = tuple(
                    (found.node_namespace, found.node_name)
                    for found in self._node.get_publishers_info_by_topic(
                        self._node.resolve_topic_name(name)
                    )
                )
            self._rivals[name] = after = before.look(name, publishers, now)
            if after.sentence:
                return after.sentence
        return ""
