"""Commands and faults from the graph: checked, handed to the machine, or refused in a sentence."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from winding_rig_node.machine.commander import CommandError
from winding_rig_node.machine.faults import FaultError, Faults, parse_faults
from winding_rig_node.machine.machine import Machine
from winding_rig_node.machine.machine_config import SENSORS
from winding_rig_node.ros.camera import CAMERA_SIGNAL
from winding_rig_node.ros.machine_loop import MachineLoop
from winding_ros import graph, topics
from winding_ros.messages.serialised import MessageError
from winding_ros.runtime.endpoints import contestants
from winding_ros.runtime.managed_node import ManagedNode
from winding_ros.topic import Topic

_LOG_PERIOD = 1.0  # A stream of refused commands is one sentence per second in the log


def take_commands(node: ManagedNode[Any], loop: MachineLoop) -> None:
    """Subscribe to every command topic; a refused command is logged and reported in diagnostics."""
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
    names = sorted({name for _, name in contestants(node, topic.name)})
    # A commander that was started again has the name of its predecessor, which lingers.
    if len(names) > 1:
        raise MessageError(f"one commander at a time, got {len(names)}: {', '.join(names)}")


TARGETS = (*SENSORS, CAMERA_SIGNAL, *(topic.name for topic in graph.RIG.publishes))
_OF_CAMERA = frozenset({CAMERA_SIGNAL, *(topic.name for topic in graph.CAMERA_TOPICS)})


def enabled_faults(
    text: str, *, enabled: bool, seed: int, camera_elsewhere: bool = False
) -> Faults:
    """Return the faults of a text.

    Raises:
        FaultError: The text is no list of faults, none are enabled, or the camera runs elsewhere.
    """
    faults = parse_faults(text, TARGETS)
    beyond = sorted(_OF_CAMERA & {fault.target for fault in faults}) if camera_elsewhere else []
    if beyond:
        raise FaultError(f"the camera runs in another process: no fault of {beyond[0]} here")
    if faults and not enabled:
        raise FaultError("faults are not enabled: start the rig with inject_faults true")
    return Faults(faults, seed=seed)


def follow_fault_parameters(node: Node, put_in: Callable[[Faults], None]) -> None:
    """Refuse a text that is no list of faults; call `put_in` with the faults of one that is."""

    def faults_of(parameters: list[Parameter]) -> Faults | None:
        given: dict[str, Any] = {parameter.name: parameter.value for parameter in parameters}
        if "inject_fault" not in given:
            return None
        # Parameters are given one by one while the node declares them.
        enabled = given.get("inject_faults", _present(node, "inject_faults", default=True))
        seed = given.get("seed", _present(node, "seed", default=0))
        elsewhere = given.get("camera_elsewhere", _present(node, "camera_elsewhere", default=False))
        return enabled_faults(
            str(given["inject_fault"]),
            enabled=bool(enabled),
            seed=int(seed),
            camera_elsewhere=bool(elsewhere),
        )

    def check(parameters: list[Parameter]) -> SetParametersResult:
        try:
            faults_of(parameters)
        except FaultError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def take(parameters: list[Parameter]) -> None:
        faults = faults_of(parameters)
        if faults is not None:
            put_in(faults)

    node.add_on_set_parameters_callback(check)
    node.add_post_set_parameters_callback(take)


def _present(node: Node, name: str, *, default: object) -> object:
    return node.get_parameter(name).value if node.has_parameter(name) else default
