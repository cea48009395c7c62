"""The graph's nodes in one process on one executor, from the same list as the processes."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any

from rclpy.context import Context
from rclpy.executors import Executor
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter

from winding_ros import topics
from winding_ros.environment import ros_arguments
from winding_ros.graph import GRAPH
from winding_supervisor.graph_error import GraphError


class ComposedGraph:
    """Nodes of the graph by name, brought up in the graph's order.

    Args:
        context: An initialised context.
        executor: Spins the nodes.
        namespace: Of the graph.
        parameters: Node name -> parameter name -> value.
        direct_frames: Hand frames from rig to tracker within the process; camera/image_raw is
            silent then.

    Raises:
        GraphError: A node refuses to come up.
    """

    def __init__(
        self,
        context: Context,
        executor: Executor,
        *,
        namespace: str,
        parameters: Mapping[str, Mapping[str, Any]],
        direct_frames: bool = False,
    ) -> None:
        self.nodes: dict[str, Any] = {}
        self._executor = executor
        for spec in GRAPH:
            node_class = getattr(importlib.import_module(f"{spec.package}.node"), spec.node_class)
            node = node_class(
                context=context,
                cli_args=ros_arguments(namespace),
                parameter_overrides=[
                    Parameter(name, value=value)
                    for name, value in {
                        "use_sim_time": True,
                        **parameters.get(spec.name, {}),
                    }.items()
                ],
            )
            self.nodes[spec.name] = node
            executor.add_node(node)
        if direct_frames:
            self.nodes[topics.RIG].frame_listener = self.nodes[topics.TRACKER].take_frame
        for transition in ("trigger_configure", "trigger_activate"):
            for name, node in self.nodes.items():
                if getattr(node, transition)() is not TransitionCallbackReturn.SUCCESS:
                    raise GraphError(f"{name} refused to {transition.removeprefix('trigger_')}")

    def close(self) -> None:
        """Stop and destroy the nodes, the rig first."""
        for node in reversed(self.nodes.values()):
            self._executor.remove_node(node)
            node.destroy_node()
