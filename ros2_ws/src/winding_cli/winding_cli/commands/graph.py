"""`winding graph`: the graph as text, Mermaid picture, tables, access policy; the URDF."""

from __future__ import annotations

from typing import Annotated

import typer

from winding_cli.commands.condition_options import spelled
from winding_cli.commands.refusal import refused


def graph(
    mermaid: Annotated[bool, typer.Option("--mermaid", help="Print a Mermaid flowchart.")] = False,
    interfaces: Annotated[
        bool, typer.Option("--interfaces", help="Print topics, services, parameters as Markdown.")
    ] = False,
    sros2: Annotated[
        bool, typer.Option("--sros2", help="Print the access policy for `ros2 security`.")
    ] = False,
    urdf: Annotated[
        bool,
        typer.Option("--urdf", help="Print the machine's URDF (robot_description)."),
    ] = False,
    case: Annotated[int, typer.Option(help="Row of Table 1 in the URDF.")] = 4,
    namespace: Annotated[str, typer.Option(help="Namespace in the policy.")] = "winding",
) -> None:
    """Show the nodes, their topics and who listens."""
    from winding_cli.output.interface_table import as_markdown
    from winding_core.cable.condition import Condition
    from winding_core.machine.axes import MachineAxes
    from winding_core.run_options import CameraPlacement
    from winding_core.urdf import machine_urdf
    from winding_ros.graph import as_mermaid, as_text
    from winding_ros.security import sros2_policy

    if urdf:
        with refused(ValueError):
            what = Condition.from_typed({"case": case}, spelling=spelled).resolved()
        print(machine_urdf(what, MachineAxes(), CameraPlacement()), end="")
    elif sros2:
        print(sros2_policy(namespace), end="")
    elif interfaces:
        print(as_markdown())
    else:
        print(as_mermaid() if mermaid else as_text())
