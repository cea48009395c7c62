"""Brings a node up, whether its process was started here or elsewhere."""

from __future__ import annotations

from lifecycle_msgs.msg import State

from winding_ros.client.lifecycle import CONFIGURE, START_TIMEOUT, LifecycleDriver
from winding_ros.graph import GraphError
from winding_supervisor.attached_node import AttachedNode
from winding_supervisor.node_process import NodeProcess

Member = NodeProcess | AttachedNode


async def configure(driver: LifecycleDriver, member: Member) -> None:
    """Bring a node that has just started to inactive.

    Raises:
        GraphError: It refused, or is not what was started.
        TimeoutError: It does not answer.
    """
    name = member.spec.name
    state = await driver.state(name, START_TIMEOUT)
    if isinstance(member, AttachedNode):
        await member.take_parameters()
    elif state.id != State.PRIMARY_STATE_UNCONFIGURED:
        raise GraphError(
            f"{name} is in state {state.id} before it was configured: another graph uses its name"
        )
    await driver.change(name, CONFIGURE)


def exit_error(member: Member) -> GraphError:
    """Return the error that names a node that ended by itself, and what it said at last."""
    said = member.complaint()
    return GraphError(
        f"{member.spec.name} ended with exit code {member.return_code}"
        + (f": {said}" if said else "")
    )
