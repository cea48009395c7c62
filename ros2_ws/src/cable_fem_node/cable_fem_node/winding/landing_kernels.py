"""Where the winding rod lands on the cylinder."""

from __future__ import annotations

from cable_fem_node.dynamics.compile import called
from cable_fem_node.dynamics.points import IntArray


@called
def landing_node(elements: int, touching: IntArray) -> int:
    """Return the outermost node that touches, 0 for none."""
    node = elements - 1
    while node > 0 and touching[node] == 0:
        node -= 1
    return node
