"""`winding graph`: the graph as text, Mermaid picture, interface tables or access policy."""

from __future__ import annotations

from typing import Annotated

import typer


def graph(
    mermaid: Annotated[bool, typer.Option("--mermaid", help="Print a Mermaid flowchart.")] = False,
    interfaces: Annotated[
        bool, typer.Option("--interfaces", help="Print topics, services, parameters as Markdown.")
    ] = False,
    sros2: Annotated[
        bool, typer.Option("--sros2", help="Print the access policy for `ros2 security`.")
    ] = False,
    namespace: Annotated[str, typer.Option(help="Namespace in the policy.")] = "winding",
) -> None:
    """Show the nodes, their topics and who listens."""
    from winding_cli.output.interface_table import as_markdown
    from winding_ros.graph import as_mermaid, as_text
    from winding_ros.security import sros2_policy

    if sros2:
        print(sros2_policy(namespace), end="")
    elif interfaces:
        print(as_markdown())
    else:
        print(as_mermaid() if mermaid else as_text())
