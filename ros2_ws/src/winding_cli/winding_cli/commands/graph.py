"""`winding graph`, `winding health`: the graph as text, picture and policy; is one running?"""

from __future__ import annotations

import math
import time
from collections.abc import Collection, Iterable
from typing import Annotated, Any

import typer

from winding_cli.terminal.record_options import Domain, Namespace, spelled
from winding_cli.terminal.refusal import FAILED, refuse, refused
from winding_cli.terminal.ros_environment import check_namespace, joined, plain_node
from winding_core.cable.condition import Condition
from winding_core.machine.axes import MachineAxes
from winding_core.parameters import Declaration, declarations
from winding_core.run_options import CameraPlacement
from winding_core.status import Level, Status
from winding_ros import topics
from winding_ros.graph import (
    GRAPH,
    LAY_CONTROL,
    PAGE,
    as_mermaid,
    as_text,
    controlled,
    members,
    parameters_of,
)
from winding_ros.runtime.heartbeat import LEASE, PERIOD, heartbeat_topic
from winding_ros.services import SERVICES
from winding_ros.topics import TOPICS


def graph(
    mermaid: Annotated[bool, typer.Option("--mermaid", help="Print a Mermaid flowchart.")] = False,
    interfaces: Annotated[
        bool, typer.Option("--interfaces", help="Print topics, services, parameters as Markdown.")
    ] = False,
    sros2: Annotated[
        bool, typer.Option("--sros2", help="Print the access policy for `ros2 security`.")
    ] = False,
    urdf: Annotated[
        bool, typer.Option("--urdf", help="Print the machine's URDF (robot_description).")
    ] = False,
    case: Annotated[int, typer.Option(help="Row of Table 1 in the URDF.")] = 4,
    namespace: Annotated[str, typer.Option(help="Namespace in the policy.")] = "winding",
    machine: Annotated[
        str, typer.Option(help="In the policy: simulated, or external with a driver of its own.")
    ] = "simulated",
    camera: Annotated[
        bool, typer.Option("--camera/--no-camera", help="Whether an external machine has one.")
    ] = True,
    machine_file: Annotated[
        str, typer.Option(help="File of the arm that carries the guide, for --urdf.")
    ] = "",
    control: Annotated[
        bool, typer.Option("--control", help="The policy's run has a wanted lay.")
    ] = False,
    dashboard: Annotated[
        bool, typer.Option("--dashboard", help="The policy's run has an operator's page.")
    ] = False,
    serve: Annotated[
        bool, typer.Option("--serve", help="The policy's runs are goals of `winding serve`.")
    ] = False,
    commander: Annotated[
        bool, typer.Option("--commander", help="A program of yours commands the machine.")
    ] = False,
) -> None:
    """Show the nodes, their topics and who listens."""
    from winding_core.arm.opening import open_arm
    from winding_core.urdf import machine_urdf
    from winding_ros.access_policy import Participants, sros2_policy

    if urdf:
        with refused(ValueError):
            what = Condition.from_typed({"case": case}, spelling=spelled).resolved()
            arm = open_arm(machine_file, what)
            description = machine_urdf(what, MachineAxes(), CameraPlacement(), arm=arm)
        print(description, end="")
    elif sros2:
        if machine not in ("simulated", "external"):
            refuse(f"--machine must be simulated or external, got {machine}")
        check_namespace(namespace)
        nodes = members(external=machine == "external", camera=camera, control=control)
        taking_part = Participants(graph=nodes, page=dashboard, server=serve, commander=commander)
        print(sros2_policy(namespace, taking_part), end="")
    elif interfaces:
        print(as_markdown())
    else:
        print(as_mermaid() if mermaid else as_text())


def as_markdown() -> str:
    """Return tables of topics, services and parameters."""
    return "\n".join([*_topics(), "", *_services(), "", *_parameters()])


def _topics() -> list[str]:
    lines = [
        "| topic | type | publisher | rate | QoS | recorded | content |",
        "|---|---|---|---|---|---|---|",
    ]
    for topic in TOPICS:
        rate = "on change" if topic.rate is None else f"{topic.rate:g} Hz"
        durability = ", latched" if topic.latched else ""
        lines.append(
            f"| `{topic.name}` | `{topic.type_name}` | {topic.publisher} | {rate} "
            f"| reliable, depth {topic.depth}{durability} | {'yes' if topic.recorded else 'no'} "
            f"| {topic.description} |"
        )
    lines.append(
        f"| `{heartbeat_topic('<node>')}` | `std_msgs/msg/Header` "
        f"| every node, orchestrator, supervised page | {1.0 / PERIOD:g} Hz "
        f"| reliable, depth 1, liveliness {LEASE:g} s but for the orchestrator's | no "
        "| signs of life; the stamp is wall time |"
    )
    return lines


def _services() -> list[str]:
    lines = ["| service | type | what it does |", "|---|---|---|"]
    lines += [f"| `{item.name}` | `{item.type_name}` | {item.description} |" for item in SERVICES]
    lines.append(
        "| `<node>/change_state`, `<node>/get_state`, ... | `lifecycle_msgs/srv/*` "
        "| lifecycle of every node |"
    )
    return lines


def _parameters() -> list[str]:
    lines = []
    for spec in (*reversed(controlled()), PAGE):
        lines += [
            f"### Parameters of `{spec.name}`",
            "",
            "| parameter | type | default | range | meaning |",
            "|---|---|---|---|---|",
        ]
        lines += [_parameter_row(item) for item in declarations(parameters_of(spec))]
        lines.append("")
    return lines[:-1]


def _parameter_row(item: Declaration) -> str:
    default = f"`{item.default}`" if item.default != "" else "empty"
    return f"| `{item.name}` | {item.type_name} | {default} | {_range(item)} | {item.description} |"


def _range(item: Declaration) -> str:
    if item.choices is not None:
        return ", ".join(f"`{choice}`" if choice else "empty" for choice in item.choices)
    if item.low is None and item.high is None:
        return ""
    if item.high is None:
        return f"at least {item.low:g}"
    if item.low is None:
        return f"at most {item.high:g}"
    return f"{item.low:g} to {item.high:g}"


def health(
    nodes: Annotated[
        list[str] | None, typer.Argument(help="Names of nodes; all of the graph by default.")
    ] = None,
    namespace: Namespace = "winding",
    domain: Domain = None,
    patience_s: Annotated[float, typer.Option(help="How long to listen for silent nodes.")] = 10.0,
) -> None:
    """Listen to /diagnostics; exit 1 when a node is silent or in error."""
    if not 0.0 < patience_s < math.inf:
        refuse(f"patience must be positive and finite, got {patience_s} s")
    usual = [spec.name for spec in GRAPH]
    known = [*usual, LAY_CONTROL.name]
    for name in nodes or ():
        if name not in known:
            refuse(f"no node {name!r} in the graph; there are {', '.join(known)}")
    wanted = nodes or usual
    with joined(domain):
        found = complaints(wanted, listen(wanted, namespace, patience_s))
    if found:
        refuse("; ".join(found), FAILED)
    print(f"{', '.join(wanted)}: heard, no errors")


def complaints(nodes: Iterable[str], heard: Collection[Status]) -> list[str]:
    """Return one sentence for each named node that is silent, and for each ERROR of the others."""
    found = []
    for node in nodes:
        own = [status for status in heard if status.name.partition(":")[0] == node]
        if not own:
            found.append(f"{node} is silent")
        found += [f"{s.name}: {s.message}" for s in own if s.level >= Level.ERROR]
    return found


def listen(nodes: Collection[str], namespace: str, patience: float) -> list[Status]:
    """Return the newest statuses in a graph once every node was heard, or after `patience` [s]."""
    heard: dict[str, Status] = {}

    def note(message: Any) -> None:
        _, statuses = topics.DIAGNOSTICS.decode(message)
        for encoded, status in zip(message.status, statuses, strict=True):
            if encoded.hardware_id == f"/{namespace}":
                heard[status.name] = status

    with plain_node("health", namespace) as (node, executor):
        topics.DIAGNOSTICS.subscribe(node, note)
        end = time.monotonic() + patience
        while time.monotonic() < end and not set(nodes) <= set(heard):
            executor.spin_once(timeout_sec=0.1)
    return list(heard.values())
