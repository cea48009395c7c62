"""Who publishes on a topic, as the node's graph knows it."""

from __future__ import annotations

from rclpy.node import Node

from winding_ros.message_guard import Endpoint


def contestants(node: Node, topic: str) -> tuple[Endpoint, ...]:
    """Return the publishers (namespace, node) of a topic that has more than one."""
    if node.count_publishers(topic) < 2:
        return ()
    found = node.get_publishers_info_by_topic(node.resolve_topic_name(topic))
    return tuple((publisher.node_namespace, publisher.node_name) for publisher in found)
