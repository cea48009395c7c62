"""Room for the scratch arrays of one step, from Python and from within kernels."""

from __future__ import annotations

import numpy as np

from cable_fem_node.dynamics.compile import called
from cable_fem_node.rod.rod_arrays import Work


@called
def empty_work(capacity: int) -> Work:
    """Return scratch arrays for so many nodes."""
    rows = np.zeros((14, capacity))
    return Work(
        rows[0:3],
        rows[3],
        rows[4],
        rows[5],
        rows[6],
        rows[7:10],
        rows[10:13],
        rows[13],
    )
