"""One-point hexahedra (C3D8R): total Lagrangian forces, hourglass control, explicit steps."""

import math
from typing import NamedTuple

import numpy as np

from cable_fem_node.dynamics.compile import kernel
from cable_fem_node.dynamics.motion_kernels import BoundaryConditions, amplitude_at, move
from cable_fem_node.dynamics.state import LOSS_DAMPING, ContactLaw, FloatArray, IntArray, Points
from cable_fem_node.solid.solid_law_kernels import piola


class HexMesh(NamedTuple):
    """Elements of a solid: geometry, law, hourglass control, viscosity."""

    hexes: IntArray  # (elements, 8)
    volume: FloatArray  # (elements,) [m^3]
    gradient: FloatArray  # (elements, 8, 3) [1/m]
    gamma: FloatArray  # (elements, 4, 8)
    hourglass: FloatArray  # (elements,) stiffness per hourglass mode [N/m]
    hourglass_drag: FloatArray  # (elements,) viscosity per hourglass mode [N s/m]
    bulk_drag: FloatArray  # (elements,) b1 rho c_d L [Pa s]
    law: int
    constants: FloatArray


@kernel
def hex_forces(
    position: FloatArray, velocity: FloatArray, mesh: HexMesh, viscous: bool, net: FloatArray
) -> tuple[int, float, float, float]:
    """Fill the nodes' internal forces (3, nodes) [N].

    Returns:
        the element that turned inside out or -1, strain energy [J], hourglass energy [J], power
        lost to viscosity [W].
    """
    nodes = net.shape[1]
    for c in range(3):
        for i in range(nodes):
            net[c, i] = 0.0
    f, p = np.empty((3, 3)), np.empty((3, 3))
    cof, one, two = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    x = np.empty((8, 3))
    v = np.empty((8, 3))
    stored = 0.0
    wavy = 0.0
    lost = 0.0
    for e in range(mesh.volume.shape[0]):
        b = mesh.gradient[e]
        gamma = mesh.gamma[e]
        for a in range(8):
            n = mesh.hexes[e, a]
            x[a, 0], x[a, 1], x[a, 2] = position[0, n], position[1, n], position[2, n]
        for i in range(3):
            f0, f1, f2 = 0.0, 0.0, 0.0
            for a in range(8):
                f0 += x[a, i] * b[a, 0]
                f1 += x[a, i] * b[a, 1]
                f2 += x[a, i] * b[a, 2]
            f[i, 0], f[i, 1], f[i, 2] = f0, f1, f2
        j, density = piola(mesh.law, f, mesh.constants, cof, one, two, p)
        if not j > 0.0:
            return e, stored, wavy, lost
        volume = mesh.volume[e]
        stored += volume * density
        if viscous:
            rate = 0.0
            for a in range(8):
                n = mesh.hexes[e, a]
                v[a, 0], v[a, 1], v[a, 2] = velocity[0, n], velocity[1, n], velocity[2, n]
            for i in range(3):
                for k in range(3):
                    slope = 0.0
                    for a in range(8):
                        slope += v[a, i] * b[a, k]
                    rate += slope * cof[i, k]
            drag = mesh.bulk_drag[e] * rate / j
            lost += volume * drag * rate
            for i in range(3):
                for k in range(3):
                    p[i, k] += drag * cof[i, k]
        for i in range(3):
            p0, p1, p2 = -volume * p[i, 0], -volume * p[i, 1], -volume * p[i, 2]
            q0, q1, q2, q3 = 0.0, 0.0, 0.0, 0.0
            for a in range(8):
                q0 += gamma[0, a] * x[a, i]
                q1 += gamma[1, a] * x[a, i]
                q2 += gamma[2, a] * x[a, i]
                q3 += gamma[3, a] * x[a, i]
            stiff = mesh.hourglass[e]
            wavy += 0.5 * stiff * (q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
            q0, q1, q2, q3 = stiff * q0, stiff * q1, stiff * q2, stiff * q3
            drag = mesh.hourglass_drag[e]
            if viscous and drag > 0.0:
                w0, w1, w2, w3 = 0.0, 0.0, 0.0, 0.0
                for a in range(8):
                    w0 += gamma[0, a] * v[a, i]
                    w1 += gamma[1, a] * v[a, i]
                    w2 += gamma[2, a] * v[a, i]
                    w3 += gamma[3, a] * v[a, i]
                lost += drag * (w0 * w0 + w1 * w1 + w2 * w2 + w3 * w3)
                q0 += drag * w0
                q1 += drag * w1
                q2 += drag * w2
                q3 += drag * w3
            for a in range(8):
                net[i, mesh.hexes[e, a]] += (
                    p0 * b[a, 0]
                    + p1 * b[a, 1]
                    + p2 * b[a, 2]
                    - q0 * gamma[0, a]
                    - q1 * gamma[1, a]
                    - q2 * gamma[2, a]
                    - q3 * gamma[3, a]
                )
    return -1, stored, wavy, lost


@kernel
def hex_stiffness(position: FloatArray, mesh: HexMesh, delta: float, matrix: FloatArray) -> int:
    """Fill the elements' tangent stiffness (elements, 24, 24) [N/m] by central differences.

    Rows and columns count node * 3 + axis. Returns the element that is inside out, or -1.
    """
    f, p = np.empty((3, 3)), np.empty((3, 3))
    cof, one, two = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    f0 = np.empty((3, 3))
    for e in range(mesh.volume.shape[0]):
        b = mesh.gradient[e]
        gamma = mesh.gamma[e]
        for i in range(3):
            for k in range(3):
                f0[i, k] = 0.0
                for a in range(8):
                    f0[i, k] += position[i, mesh.hexes[e, a]] * b[a, k]
        volume = mesh.volume[e]
        for a in range(8):
            for i in range(3):
                column = 3 * a + i
                for c in range(8):
                    for k in range(3):
                        matrix[e, 3 * c + k, column] = 0.0
                for side in range(2):
                    sign = 1.0 if side == 0 else -1.0
                    for r in range(3):
                        for k in range(3):
                            f[r, k] = f0[r, k]
                    for k in range(3):
                        f[i, k] += sign * delta * b[a, k]
                    j, _ = piola(mesh.law, f, mesh.constants, cof, one, two, p)
                    if not j > 0.0:
                        return e
                    factor = 0.5 * sign * volume / delta
                    for c in range(8):
                        for r in range(3):
                            matrix[e, 3 * c + r, column] += factor * (
                                p[r, 0] * b[c, 0] + p[r, 1] * b[c, 1] + p[r, 2] * b[c, 2]
                            )
                for c in range(8):
                    wave = 0.0
                    for h in range(4):
                        wave += gamma[h, a] * gamma[h, c]
                    matrix[e, 3 * c + i, column] += mesh.hourglass[e] * wave
    return -1


@kernel
def advance_solid(
    steps: int,
    dt: float,
    start: float,
    points: Points,
    mesh: HexMesh,
    net: FloatArray,
    couple: FloatArray,
    around: BoundaryConditions,
    touch: ContactLaw,
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
