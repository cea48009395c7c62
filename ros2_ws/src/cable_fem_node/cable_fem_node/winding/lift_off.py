"""Where a cable with bending stiffness leaves the cylinder, between two nodes of the rod."""

from __future__ import annotations

import numpy as np

from cable_fem_node.dynamics.points import FloatArray

# Laid nodes behind the edge whose mean curvature is the cylinder's: the edge's own push has
# decayed over the two that are left out.
_LAID = slice(-7, -2)
# Free nodes that the bending moment is followed over.
_FREE = 4


def lift_off_angle(position: FloatArray, reference: FloatArray, laid: int) -> float:
    """Return the azimuth [rad] at which the free cable's curvature reaches the cylinder's.

    The moment is continuous there and decays along the free cable nearly as an exponential; its
    logarithm over the first free nodes is followed back by a parabola. Nodes land and leave one
    by one, the moment changes steadily.

    Args:
        position: Of the nodes across the cylinder's axis [m], shape (2, n).
        reference: Reference lengths of the elements [m], shape (n - 1,).
        laid: Nodes that lie on the cylinder.

    Raises:
        ValueError: Too little cable lies, or elements are too long to see it bend off the cylinder.
    """
    if not 8 <= laid <= position.shape[1] - _FREE - 1:
        raise ValueError(
            f"lift-off needs 8 nodes on the cylinder and {_FREE + 1} off it, got {laid} of "
            f"{position.shape[1]}"
        )
    edge = np.diff(position, axis=1)
    turning = np.arctan2(
        edge[0, :-1] * edge[1, 1:] - edge[1, :-1] * edge[0, 1:],
        (edge[:, :-1] * edge[:, 1:]).sum(axis=0),
    )
    curvature = np.abs(2.0 * turning / (reference[:-1] + reference[1:]))
    # Entry i belongs to node i + 1: the last laid node is entry laid - 2.
    on_cylinder = float(curvature[: laid - 1][_LAID].mean())
    free = slice(laid - 1, laid - 1 + _FREE)
    share = curvature[free] / on_cylinder
    if not (np.all(np.diff(share) < 0.0) and share[-1] > 0.05):
        raise ValueError(
            f"over the first {_FREE} elements off the cylinder the curvature falls to "
            f"{share[-1]:.2g} of the cylinder's (limit 0.05): take shorter elements"
        )
    azimuth = np.arctan2(position[1], position[0])[laid : laid + _FREE]
    return float(np.polyval(np.polyfit(np.log(share), azimuth, 2), 0.0))
