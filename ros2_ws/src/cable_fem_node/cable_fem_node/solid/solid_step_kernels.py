"""Explicit steps of the general solid model."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.compile import kernel
from cable_fem_node.dynamics.contact_kernels import touch_cylinder
from cable_fem_node.dynamics.motion_kernels import amplitude_at, move
from cable_fem_node.dynamics.points import LOSS_DAMPING, Points
from cable_fem_node.dynamics.surroundings import Surroundings, Touch
from cable_fem_node.solid.hex_kernels import HexMesh, hex_forces

FloatArray = NDArray[np.float64]


@kernel
def advance_solid(
    steps: int,
    dt: float,
    start: float,
    turned: float,
    points: Points,
    mesh: HexMesh,
    net: FloatArray,
    couple: FloatArray,
    around: Surroundings,
    touch: Touch,
    ledger: FloatArray,
) -> tuple[int, float, float]:
    """Advance a solid by equal steps.

    Returns:
        the element at fault or -1, the last step's rotation, the kinetic energy [J].
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
            return at, turned, kinetic
        ledger[LOSS_DAMPING] += dt * lost
        turning = around.angular_speed * dt
        if around.reach > 0.0:
            touch_cylinder(
                0, nodes, dt, turned, turning, around.reach, points, net, couple, touch, ledger,
                False,
            )  # fmt: skip
        turned = turning
        drive = amplitude_at(t + 0.5 * dt, around.drive_times, around.drive_values)
        kinetic = move(
            nodes, dt, kick, points.position, points.velocity, net, around.load, factor,
            around.gravity, around.mass, around.free, around.driven, drive, around.damping_rate,
            ledger,
        )  # fmt: skip
        kick = 1.0
        if around.calming:
            if kinetic < peak:
                kick = 0.5
                points.velocity[:, :nodes] *= 1.0 - around.free
                peak = 0.0
            else:
                peak = kinetic
    if not math.isfinite(kinetic):
        return 0, turned, kinetic
    return -1, turned, kinetic
