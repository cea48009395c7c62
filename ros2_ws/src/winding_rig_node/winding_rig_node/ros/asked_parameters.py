"""The rig's parameters, asked of the rig by what runs in another process."""

from __future__ import annotations

from rcl_interfaces.srv import GetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python

from winding_core.parameters import build, declarations
from winding_rig_node.ros.parameters import RigParameters
from winding_ros import topics

# An answer is lost while client and server find each other, so the request is repeated.
_ATTEMPTS = 20
_PATIENCE = 0.5


class SilentRigError(ValueError):
    """The rig does not say what it is set to."""


def asked_parameters(node: Node) -> RigParameters:
    """Return what the rig of a node's namespace is set to now.

    Args:
        node: Asks; spun by nobody else.

    Raises:
        SilentRigError: The rig does not answer.
        ParameterError: It answers with something else.
    """
    names = [item.name for item in declarations(RigParameters)]
    client = node.create_client(GetParameters, f"{topics.RIG}/get_parameters")
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    try:
        for _ in range(_ATTEMPTS):
            if not client.wait_for_service(timeout_sec=_PATIENCE):
                continue
            answer = client.call_async(GetParameters.Request(names=names))
            executor.spin_until_future_complete(answer, timeout_sec=_PATIENCE)
            if answer.done():
                values = map(parameter_value_to_python, answer.result().values)
                given = dict(zip(names, values, strict=False))
                return build(RigParameters, given, owner=topics.RIG)
    finally:
        executor.remove_node(node)
        executor.shutdown()
        node.destroy_client(client)
    waited = _ATTEMPTS * _PATIENCE
    raise SilentRigError(f"{topics.RIG} does not say within {waited:g} s what it is set to")
