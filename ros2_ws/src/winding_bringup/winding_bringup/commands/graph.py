"""`winding graph`: the graph as text, as a Mermaid picture, or as interface tables."""

from __future__ import annotations

from typing import Annotated

import typer


def graph(
    mermaid: Annotated[bool, typer.Option("--mermaid", help="Print a Mermaid flowchart.")] = False,
    interfaces: Annotated[
        bool, typer.Option("--interfaces", help="Print topics, services, parameters as Markdown.")
    ] = False,
) -> None:
    """Show the nodes, their topics and who listens."""
    from winding_bringup.graph import as_mermaid, as_text
    from winding_bringup.interface_table import as_markdown

    if interfaces:
        print(as_markdown())
    else:
        print(as_mermaid() if mermaid else as_text())
