"""A node from outside the graph, as a process: external_node.py NAMESPACE ROLE [WORDS]."""

import json
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import rclpy
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_srvs.srv import Trigger

from winding_core.status import OUTCOME_COMPONENT, Level, Status
from winding_ros import topics
from winding_ros.messages.diagnostics import decode_diagnostics
from winding_ros.messages.rig import encode_tension
from winding_ros.messages.stamps import serialised_stamp_ns
from winding_ros.runtime.process import end_with_supervisor

_RUN_OF_SAMPLES = 100


def main(namespace: str, role: str, *words: str) -> None:
    """Play a role from the first line of input on; the first line of output is its report."""
    end_with_supervisor()
    rclpy.init(args=["external", "--ros-args", "-r", f"__ns:=/{namespace}"])
    node = Node(role)
    roles: dict[str, Callable[..., None]] = {
        "rogue": _rogue,
        "mismatch": _mismatch,
        "late": _late,
        "set": _set,
        "call": _call,
        "outcome": _outcome,
    }
    sys.stdin.readline()
    roles[role](node, *words)


def _report(text: object) -> None:
    print(text, flush=True)


def _rogue(node: Node, kind: str = "") -> None:
    """Publish a second tension, with a bad stamp or cut in two; report when it began [s]."""
    publisher = topics.TENSION.advertise(node)
    message = encode_tension(1.0e6 if kind == "stamped" else 0.0, 1.0e6)
    if kind == "truncated":
        message = message[: len(message) // 2]
    _report(time.monotonic())
    node.create_timer(0.01, lambda: publisher.publish(message))
    rclpy.spin(node)


def _answer(node: Node, service: type, name: str, request: Any) -> Any:
    client = node.create_client(service, name)
    client.wait_for_service()
    pending = client.call_async(request)
    rclpy.spin_until_future_complete(node, pending)
    return pending.result()


def _set(node: Node, of: str, name: str, text: str = "") -> None:
    """Set a parameter of a node; report why it was refused."""
    value: Any = text
    with suppress(ValueError):
        value = float(text)
    request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
    answer = _answer(node, SetParameters, f"{of}/set_parameters", request)
    _report(answer.results[0].reason or "set")


def _call(node: Node, name: str) -> None:
    """Call a service of the machine until it takes it, as it does no reset while it moves."""
    while not (answer := _answer(node, Trigger, name, Trigger.Request())).success:
        time.sleep(0.1)
    _report(answer.message)


def _mismatch(node: Node) -> None:
    """Subscribe with a quality of service that is not offered; report what the machine reports."""
    wanted = QoSProfile(
        depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
    )
    node.create_subscription(
        topics.JOINT_STATES.type, topics.JOINT_STATES.name, lambda _message: None, wanted
    )
    _report(_diagnostics(node, f"{topics.RIG}: quality of service", Level.ERROR).message)


def _outcome(node: Node) -> None:
    """Report the sentences of the outcome that the operator's page is given."""
    while True:
        values = _diagnostics(node, f"{topics.ORCHESTRATOR}: {OUTCOME_COMPONENT}").values
        if "sentences" in values:
            _report(json.dumps(values["sentences"].splitlines()))
            return


def _diagnostics(node: Node, name: str, level: Level = Level.OK) -> Status:
    """Wait for the next status of a name, of a level or above."""
    found: list[Status] = []

    def look(message: Any) -> None:
        _, statuses = decode_diagnostics(message)
        found.extend(item for item in statuses if item.name == name and item.level >= level)

    subscription = topics.DIAGNOSTICS.subscribe(node, look)
    while not found:
        rclpy.spin_once(node, timeout_sec=0.1)
    node.destroy_subscription(subscription)
    return found[0]


def _late(node: Node) -> None:
    """Read what is latched and what is live; report what came."""
    latched: list[Any] = []
    stamps: list[int] = []
    topics.FEM_PREDICTION.subscribe(node, latched.append)
    topics.JOINT_STATES.subscribe(
        node, lambda data: stamps.append(round(serialised_stamp_ns(data) / 1e6)), raw=True
    )
    while not (latched and len(stamps) >= _RUN_OF_SAMPLES):
        rclpy.spin_once(node, timeout_sec=0.1)
    first = stamps[0]
    whole = stamps[:_RUN_OF_SAMPLES] == list(range(first, first + _RUN_OF_SAMPLES))
    _report(
        f"got the prediction and {_RUN_OF_SAMPLES} encoder samples "
        + ("in a row" if whole else "with holes")
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
