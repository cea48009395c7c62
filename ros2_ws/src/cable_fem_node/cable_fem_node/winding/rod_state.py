"""State of the integrated nodes: one array, so that a kernel is called quickly."""

from __future__ import annotations

from cable_fem_node.dynamics.compile import called
from cable_fem_node.dynamics.points import FloatArray, IntArray, Points

# Rows of the state: what `points_of` takes, the reference lengths of the elements, and where the
# cable relaxes the elements' elastic force and one viscous force per term.
STATE_ROWS = 12
REFERENCE = 11
VISCOUS = 12


@called
def points_of(state: FloatArray, touching: IntArray) -> Points:
    """Return the rows of a state (STATE_ROWS, capacity) as views; few arrays are quickly passed."""
    return Points(
        state[0:3],
        state[3:6],
        state[6:8],
        state[8],
        touching,
        state[9:11],
    )
