"""One central-difference step of free and driven nodes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.compile import kernel
from cable_fem_node.dynamics.points import LOSS_DAMPING, WORK_SPAN, WORK_TIE

FloatArray = NDArray[np.float64]


@kernel
def amplitude_at(t: float, times: FloatArray, values: FloatArray) -> float:
    """Return the piecewise linear amplitude of loads and driven nodes; constant beyond its ends."""
    last = times.shape[0] - 1
    if t <= times[0]:
        value: float = values[0]
        return value
    for i in range(last):
        if t < times[i + 1]:
            share = (t - times[i]) / (times[i + 1] - times[i])
            value = values[i] + share * (values[i + 1] - values[i])
            return value
    value = values[last]
    return value


@kernel
def move(
    nodes: int,
    dt: float,
    kick: float,
    position: FloatArray,
    velocity: FloatArray,
    net: FloatArray,
    load: FloatArray,
    load_factor: float,
    gravity: FloatArray,
    mass: FloatArray,
    free: FloatArray,
    driven: FloatArray,
    drive_factor: float,
    damping_rate: float,
    ledger: FloatArray,
) -> float:
    """Move every node by one step; return the kinetic energy [J] at the middle of the step.

    Args:
        nodes: Number of nodes.
        dt: Step [s].
        kick: Share of a step: 1, or 1/2 from rest, as velocities live at half steps.
        position: (3, nodes) [m], changed.
        velocity: (3, nodes) [m/s], changed.
        net: Internal and contact forces (3, nodes) [N].
        load: Nodal loads (3, nodes) [N] at amplitude one.
        load_factor: Amplitude of the loads.
        gravity: (3,) [m/s^2].
        mass: (nodes,) [kg].
        free: (3, nodes), 1 where free, 0 where the motion is given.
        driven: Given velocities (3, nodes) [m/s] at amplitude one.
        drive_factor: Amplitude of the given velocities.
        damping_rate: Mass-proportional damping [1/s].
        ledger: Energies [J], added to.
    """
    half = 0.5 * damping_rate * dt
    loads = 0.0
    ties = 0.0
    damping = 0.0
    kinetic = 0.0
    for c in range(3):
        pull = gravity[c]
        for i in range(nodes):
            before = velocity[c, i]
            given = load_factor * load[c, i] + mass[i] * pull
            force = net[c, i] + given
            moved = (before * (1.0 - half) + kick * dt * force / mass[i]) / (1.0 + half)
            held = 1.0 - free[c, i]
            after = free[c, i] * moved + held * drive_factor * driven[c, i]
            middle = 0.5 * (before + after)
            loads += given * after
            ties -= held * force * after
            damping += free[c, i] * mass[i] * middle * middle
            kinetic += free[c, i] * mass[i] * after * after
            velocity[c, i] = after
            position[c, i] += dt * after
    ledger[WORK_SPAN] += dt * loads
    ledger[WORK_TIE] += dt * ties
    ledger[LOSS_DAMPING] += dt * damping_rate * damping
    return 0.5 * kinetic
