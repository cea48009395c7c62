"""The predicted cable as evenly spaced dots with their tension."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# The span to the guide leaves the picture above this height over the axis [m].
_TOP = 0.07
# Enough dots to look like a cable and few enough to send five times a second.
CABLE_POINTS = 360
# A tension that varies by less is one colour [N]; the load cell's noise is 0.01 N.
_LEAST_SPREAD = 0.05


@dataclass(frozen=True, kw_only=True)
class CableShape:
    """The cable as dots.

    Attributes:
        points: In the lab frame, shape (n, 3) [m].
        share: Of the tension between low and high, shape (n,).
        low: Least tension [N].
        high: Largest tension [N].
    """

    points: FloatArray
    share: FloatArray
    low: float
    high: float


def cable_shape(cable: NDArray[np.void], count: int = CABLE_POINTS) -> CableShape | None:
    """Return the cable's nodes as evenly spaced dots; None for less than two finite nodes.

    Args:
        cable: Records of CABLE_DTYPE, in order along the cable.
        count: Number of dots.
    """
    nodes = np.stack([cable[name] for name in ("x", "y", "z")], axis=1).astype(float)
    tension = cable["tension"].astype(float)
    finite = np.isfinite(nodes).all(axis=1) & np.isfinite(tension) & (nodes[:, 1] > -_TOP)
    nodes, tension = nodes[finite], tension[finite]
    if len(nodes) < 2:
        return None
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(nodes, axis=0), axis=1))])
    at = np.linspace(0.0, way[-1], count)
    dots = np.stack([np.interp(at, way, column) for column in nodes.T], axis=1)
    along = np.interp(at, way, tension)
    low, high = float(tension.min()), float(tension.max())
    share = (along - low) / max(high - low, _LEAST_SPREAD)
    return CableShape(points=dots, share=share, low=low, high=high)
