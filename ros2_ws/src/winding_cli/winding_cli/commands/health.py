"""`winding health`: is a running graph heard, and does it complain?"""

from __future__ import annotations

import math
from typing import Annotated

import typer

from winding_cli.commands.refusal import FAILED, refuse
from winding_cli.commands.ros_environment import joined


def health(
    nodes: Annotated[
        list[str] | None, typer.Argument(help="Names of nodes; all of the graph by default.")
    ] = None,
    namespace: Annotated[str, typer.Option(help="Namespace of the graph.")] = "winding",
    domain: Annotated[
        int | None, typer.Option(help="DDS domain; else ROS_DOMAIN_ID, else 0.")
    ] = None,
    patience_s: Annotated[float, typer.Option(help="How long to listen for silent nodes.")] = 10.0,
) -> None:
    """Listen to /diagnostics; exit 1 when a node is silent or in error."""
    from winding_ros.graph import GRAPH, LAY_CONTROL
    from winding_supervisor.node_health import complaints, listen

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
