"""Where a predicted cable lies, from the nodes of its centreline."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# A bent cable stands off by less, and the free span leaves the cylinder within a few degrees.
_WOUND = 1.02


def cable_lay(cable: NDArray[np.void], cylinder_angle: float, radius: float) -> tuple[Array, Array]:
    """Return wound angle [rad] and z [m] of the nodes that lie on the cylinder, shape (n,) each.

    Args:
        cable: Records of CABLE_DTYPE, in order along the cable; older turns may be missing.
        cylinder_angle: Theta [rad] at the cable's time.
        radius: Centreline radius R + r [m].
    """
    x, y, z = (cable[name].astype(float) for name in "xyz")
    wound = np.flatnonzero(np.hypot(x, y) < _WOUND * radius)
    if not wound.size:
        return np.zeros(0), np.zeros(0)
    wound = np.arange(wound[0], wound[-1] + 1)
    azimuth = np.arctan2(y[wound], x[wound])
    # The newest node lies near the contact line, at azimuth 0; the others follow from it.
    turned = np.unwrap(azimuth)
    return cylinder_angle - azimuth[-1] + turned[-1] - turned, z[wound]
