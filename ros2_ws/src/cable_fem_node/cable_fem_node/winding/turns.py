"""How the turns of wound cable lie: apart, touching one laid before, or on cable."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.state import FloatArray

APART, TOUCHING, ON_CABLE = "apart", "touching", "on cable"
# In the distance of touching centre lines: springs between turns give way by half a per cent, and a
# node between two others stands higher by less than a tenth.
_CONTACT, _RAISED = 1.01, 0.1
# Places in a turn at which it is compared with those before.
_PLACES = 180


def on_cable(radius: FloatArray, apart: float) -> NDArray[np.bool_]:
    """Return which nodes of wound cable stand out from those that lie on the cylinder, shape (n,).

    Args:
        radius: Distances from the axis [m], shape (n,).
        apart: Distance of touching centre lines [m].
    """
    return np.asarray(radius - radius.min(initial=np.inf) > _RAISED * apart)


def how_turns_lie(
    theta: FloatArray, z: FloatArray, radius: FloatArray, apart: float
) -> tuple[str, ...]:
    """Return how each complete turn lies, by its closest place.

    Args:
        theta: Wound angles of the cable's nodes from P0 on [rad], ascending, shape (n,).
        z: Axial positions [m], shape (n,).
        radius: Distances from the axis [m], shape (n,).
        apart: Distance of touching centre lines [m].

    Returns:
        APART, TOUCHING or ON_CABLE for each turn, the first one first.
    """
    turns = int(theta[-1] / math.tau)
    at = math.tau * np.arange(turns * _PLACES).reshape(turns, _PLACES) / _PLACES
    across, out = np.interp(at, theta, z), np.interp(at, theta, radius)
    # Where the cable begins, and where a node has just landed, it is held by others than these.
    raised = on_cable(out, apart).sum(axis=1) > 1
    found = []
    for turn in range(turns):
        way = np.hypot(across[:turn] - across[turn], out[:turn] - out[turn])
        touching = turn > 0 and float(way.min()) < _CONTACT * apart
        found.append(ON_CABLE if raised[turn] else TOUCHING if touching else APART)
    return tuple(found)
