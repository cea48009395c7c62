"""`winding graph`: the graph as text or as a Mermaid picture."""

from __future__ import annotations

from typing import Annotated

import typer


def graph(
    mermaid: Annotated[bool, typer.Option(help="Print a Mermaid flowchart.")] = False,
) -> None:
    """Show the nodes, their topics and who listens."""
    from winding_bringup.graph import as_mermaid, as_text

    print(as_mermaid() if mermaid else as_text())
