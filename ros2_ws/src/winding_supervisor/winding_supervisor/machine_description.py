"""Publishes the machine's URDF, for whoever shows the cell or plans in it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rclpy.node import Node
from std_msgs.msg import String

from winding_core.parameters import build
from winding_core.run_options import CameraPlacement
from winding_core.urdf import machine_urdf
from winding_ros.graph import FEM, TRACKER, parameters_of
from winding_ros.topics import ROBOT_DESCRIPTION
from winding_supervisor.run_config import RunConfig


def describe_machine(
    config: RunConfig, axes: Mapping[str, object], node: Node, say: Callable[[str], None]
) -> None:
    """Publish robot_description, latched, from the condition that the nodes are run with.

    Args:
        config: The run.
        axes: Parameters of those nodes that read the machine's axes.
        node: Publishes it for as long as it lives.
        say: Takes the sentence when the machine has no URDF.
    """
    names = {spec.name for spec in config.graph}
    spec = TRACKER if TRACKER.name in names else FEM
    wound: Any = build(parameters_of(spec), config.parameters(axes)[spec.name], owner=spec.name)
    try:
        camera = wound if isinstance(wound, CameraPlacement) else None
        urdf = machine_urdf(wound.resolved(), wound, camera)
    except ValueError as error:
        say(f"no {ROBOT_DESCRIPTION.name}: {error}")
        return
    ROBOT_DESCRIPTION.advertise(node).publish(String(data=urdf))
