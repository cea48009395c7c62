"""What outside commanders publish: decoded, handed to the machine, or refused in one sentence."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from winding_rig_node.machine.commander import CommandError
from winding_rig_node.machine.machine import Machine
from winding_rig_node.ros.machine_loop import MachineLoop
from winding_ros import topics
from winding_ros.messages.serialised import MessageError
from winding_ros.runtime.managed_node import ManagedNode
from winding_ros.topic import Topic

# A stream of refused commands is one sentence per second in the log.
_LOG_PERIOD = 1.0


def take_commands(node: ManagedNode[Any], loop: MachineLoop) -> None:
    """Subscribe to every command topic; a refused command is logged and told in diagnostics."""
    for topic in topics.published_by(topics.COMMANDER):
        node.endpoints.listen(topic, _taker(node, loop, topic))


def _taker(node: ManagedNode[Any], loop: MachineLoop, topic: Topic) -> Callable[[Any], None]:
    def take(message: Any) -> None:
        try:
            try:
                command = topic.decode(message)[1]
                _refuse_rivals(node, topic)
            except MessageError as error:
                loop.command(partial(_refuse, str(error)))
                raise
            loop.command(lambda machine: machine.command(command))
        except (MessageError, CommandError) as error:
            node.get_logger().warning(
                f"refused a command on {topic.name}: {error}", throttle_duration_sec=_LOG_PERIOD
            )

    return take


def _refuse(reason: str, machine: Machine) -> None:
    machine.commander.refuse(reason)


def _refuse_rivals(node: ManagedNode[Any], topic: Topic) -> None:
    if node.count_publishers(topic.name) < 2:
        return
    found = node.get_publishers_info_by_topic(node.resolve_topic_name(topic.name))
    names = sorted({item.node_name for item in found})
    # A commander that was started again has the name of its predecessor, which lingers.
    if len(names) > 1:
        raise MessageError(f"one commander at a time, got {len(names)}: {', '.join(names)}")
