"""Explicit steps of the general solid model."""

from __future__ import annotations

import math

from cable_fem_node.dynamics.compile import kernel
from cable_fem_node.dynamics.motion_kernels import amplitude_at, move
from cable_fem_node.dynamics.points import LOSS_DAMPING, FloatArray, Points
from cable_fem_node.dynamics.surroundings import Surroundings, Touch
from cable_fem_node.solid.hex_kernels import HexMesh, hex_forces


@kernel
def advance_solid(
    steps: int,
    dt: float,
    start: float,
    points: Points,
    mesh: HexMesh,
    net: FloatArray,
    couple: FloatArray,
    around: Surroundings,
    touch: Touch,
    ledger: FloatArray,
) -> tuple[int, float]:
    """Advance a solid by equal steps.

    Returns:
        the element at fault or -1, the kinetic energy [J].
    """
    nodes = net.shape[1]
    peak = 0.0
    kinetic = 0.0
    kick = 0.5 if around.calming else 1.0
    for step in range(steps):
        t = start + step * dt
        factor = amplitude_at(t, around.load_times, around.load_values)
        at, _, _, lost = hex_forces(points.position, points.velocity, mesh, True, net)
        if at >= 0:
            return at, kinetic
        ledger[LOSS_DAMPING] += dt * lost
        kinetic = move(dt, kick, points, net, couple, around, factor, touch, ledger)
        kick = 1.0
        if around.calming:
            if kinetic < peak:
                kick = 0.5
                points.velocity[:, :nodes] *= 1.0 - around.free
                peak = 0.0
            else:
                peak = kinetic
    if not math.isfinite(kinetic):
        return 0, kinetic
    return -1, kinetic
