"""The rig's parameters `inject_faults` and `inject_fault`: checked, then put in."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from winding_rig_node.machine.faults import FaultError, Faults, parse_faults
from winding_rig_node.machine.machine_config import SENSORS
from winding_rig_node.ros.camera import CAMERA_SIGNAL
from winding_ros import graph

TARGETS = (*SENSORS, CAMERA_SIGNAL, *(topic.name for topic in graph.RIG.publishes))
_OF_CAMERA = frozenset({CAMERA_SIGNAL, *(topic.name for topic in graph.CAMERA_TOPICS)})


def stated_faults(text: str, *, enabled: bool, seed: int, camera_elsewhere: bool = False) -> Faults:
    """Return the faults that a text states.

    Raises:
        FaultError: The text states none, faults are not enabled, or the camera runs elsewhere.
    """
    faults = parse_faults(text, TARGETS)
    beyond = sorted(_OF_CAMERA & {fault.target for fault in faults}) if camera_elsewhere else []
    if beyond:
        raise FaultError(f"the camera runs in another process: no fault of {beyond[0]} here")
    if faults and not enabled:
        raise FaultError("faults are not enabled: start the rig with inject_faults true")
    return Faults(faults, seed=seed)


def follow_fault_parameters(node: Node, put_in: Callable[[Faults], None]) -> None:
    """Refuse a text that states no fault; call `put_in` with the faults of one that does."""

    def faults_of(parameters: list[Parameter]) -> Faults | None:
        given: dict[str, Any] = {parameter.name: parameter.value for parameter in parameters}
        if "inject_fault" not in given:
            return None
        # Parameters are given one by one while the node declares them.
        enabled = given.get("inject_faults", _present(node, "inject_faults", default=True))
        seed = given.get("seed", _present(node, "seed", default=0))
        elsewhere = given.get("camera_elsewhere", _present(node, "camera_elsewhere", default=False))
        return stated_faults(
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
