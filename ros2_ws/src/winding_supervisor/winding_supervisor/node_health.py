"""Is a node heard, and does it complain? For a container's health check."""

from __future__ import annotations

import time
from collections.abc import Collection, Iterable
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from winding_core.status import Level, Status
from winding_ros import topics
from winding_ros.environment import ros_arguments
from winding_ros.messages.diagnostics import decode_diagnostics

_NAME = "health"


def complaints(nodes: Iterable[str], heard: Collection[Status]) -> list[str]:
    """Return one sentence for each node that is silent and for each ERROR of the others.

    Args:
        nodes: Node names.
        heard: What was said in /diagnostics, "node" or "node: component".
    """
    found = []
    for node in nodes:
        own = [status for status in heard if status.name.partition(":")[0] == node]
        if not own:
            found.append(f"{node} is silent")
        found += [f"{s.name}: {s.message}" for s in own if s.level >= Level.ERROR]
    return found


def listen(nodes: Collection[str], namespace: str, patience: float) -> list[Status]:
    """Return the newest statuses in a graph once every node was heard, or after `patience` [s].

    Args:
        nodes: Node names.
        namespace: Of the graph, without slashes around it.
        patience: Wall time [s].
    """
    context = Context()
    rclpy.init(context=context, args=[_NAME])
    heard: dict[str, Status] = {}

    def note(message: Any) -> None:
        _, statuses = decode_diagnostics(message)
        for said, status in zip(message.status, statuses, strict=True):
            if said.hardware_id == f"/{namespace}":
                heard[status.name] = status

    node = Node(_NAME, context=context, cli_args=ros_arguments(namespace))
    executor = SingleThreadedExecutor(context=context)
    try:
        topics.DIAGNOSTICS.subscribe(node, note)
        executor.add_node(node)
        end = time.monotonic() + patience
        while time.monotonic() < end and not set(nodes) <= set(heard):
            executor.spin_once(timeout_sec=0.1)
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown(context=context)
    return list(heard.values())
