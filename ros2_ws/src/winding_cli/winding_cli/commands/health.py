"""`winding health`: is a running graph heard, and does it report errors?"""

from __future__ import annotations

import math
import time
from collections.abc import Collection, Iterable
from typing import TYPE_CHECKING, Annotated, Any

import typer

from winding_cli.terminal.record_options import Domain, Namespace
from winding_cli.terminal.refusal import FAILED, refuse
from winding_cli.terminal.ros_environment import joined, plain_node

if TYPE_CHECKING:
    from winding_core.status import Status


def health(
    nodes: Annotated[
        list[str] | None, typer.Argument(help="Names of nodes; all of the graph by default.")
    ] = None,
    namespace: Namespace = "winding",
    domain: Domain = None,
    patience_s: Annotated[float, typer.Option(help="How long to listen for silent nodes.")] = 10.0,
) -> None:
    """Listen to /diagnostics; exit 1 when a node is silent or in error."""
    from winding_ros.graph import GRAPH, LAY_CONTROL

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
    """Return one sentence for each node that is silent and for each ERROR of the others.

    Args:
        nodes: Node names.
        heard: Statuses of /diagnostics, "node" or "node: component".
    """
    from winding_core.status import Level

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
    from winding_ros import topics
    from winding_ros.messages.diagnostics import decode_diagnostics

    heard: dict[str, Status] = {}

    def note(message: Any) -> None:
        _, statuses = decode_diagnostics(message)
        for encoded, status in zip(message.status, statuses, strict=True):
            if encoded.hardware_id == f"/{namespace}":
                heard[status.name] = status

    with plain_node("health", namespace) as (node, executor):
        topics.DIAGNOSTICS.subscribe(node, note)
        end = time.monotonic() + patience
        while time.monotonic() < end and not set(nodes) <= set(heard):
            executor.spin_once(timeout_sec=0.1)
    return list(heard.values())
