"""Bending and twist of a rod with material frames: for curved, twisted or coupled problems.

Discrete elastic rods (Bergou et al. 2008, 2010): every element carries a reference frame that is
parallel transported in time and a material angle theta against it; curvature and twist count
against natural values. Isotropic section: one EI, one GJ.

Curvature binormal at a node between tangents t, u: kb = 2 t x u / (1 + t.u), so a circle of
chords l has |kb| = 2 tan(phi / 2).
"""

from __future__ import annotations

import math

import numpy as np

from cable_fem_node.dynamics.compile import called, kernel
from cable_fem_node.dynamics.state import FloatArray


@kernel
def transport(
    ax: float, ay: float, az: float, bx: float, by: float, bz: float, v: FloatArray
) -> None:
    """Parallel transport v, shape (3,), from unit tangent a to unit tangent b, in place."""
    cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    dot = ax * bx + ay * by + az * bz
    along = (cx * v[0] + cy * v[1] + cz * v[2]) / (1.0 + dot)
    x = v[0] * dot + cy * v[2] - cz * v[1] + cx * along
    y = v[1] * dot + cz * v[0] - cx * v[2] + cy * along
    z = v[2] * dot + cx * v[1] - cy * v[0] + cz * along
    v[0], v[1], v[2] = x, y, z


@called
def carry_frames(
    elements: int, tangent: FloatArray, carried: FloatArray, director: FloatArray
) -> None:
    """Bring the reference directors (3, elements) from the carried tangents to the new ones."""
    v = np.empty(3)
    for i in range(elements):
        v[0], v[1], v[2] = director[0, i], director[1, i], director[2, i]
        transport(
            carried[0, i], carried[1, i], carried[2, i],
            tangent[0, i], tangent[1, i], tangent[2, i], v,
        )  # fmt: skip
        along = v[0] * tangent[0, i] + v[1] * tangent[1, i] + v[2] * tangent[2, i]
        for c in range(3):
            v[c] -= along * tangent[c, i]
        size = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
        for c in range(3):
            director[c, i] = v[c] / size
            carried[c, i] = tangent[c, i]


@called
def reference_twist(
    elements: int, tangent: FloatArray, director: FloatArray, twist: FloatArray
) -> None:
    """Update the reference frames' own twist (nodes,) [rad], without jumps of whole turns."""
    v = np.empty(3)
    for i in range(elements + 1):
        v[0], v[1], v[2] = director[0, i], director[1, i], director[2, i]
        tx, ty, tz = tangent[0, i + 1], tangent[1, i + 1], tangent[2, i + 1]
        transport(tangent[0, i], tangent[1, i], tangent[2, i], tx, ty, tz, v)
        bx, by, bz = director[0, i + 1], director[1, i + 1], director[2, i + 1]
        cosine = v[0] * bx + v[1] * by + v[2] * bz
        sine = (
            tx * (v[1] * bz - v[2] * by)
            + ty * (v[2] * bx - v[0] * bz)
            + tz * (v[0] * by - v[1] * bx)
        )
        angle = math.atan2(sine, cosine)
        twist[i] = angle + 2.0 * math.pi * round((twist[i] - angle) / (2.0 * math.pi))


@called
def frame_forces(
    begin: int,
    end: int,
    tangent: FloatArray,
    inverse: FloatArray,
    director: FloatArray,
    angle: FloatArray,
    own_twist: FloatArray,
    length: FloatArray,
    natural: FloatArray,
    bending: float,
    torsion: float,
    lag: float,
    force: FloatArray,
    torque: FloatArray,
    curvature: FloatArray,
) -> tuple[float, float]:
    """Add bending and twisting forces; return their stored energy and what was lost [J].

    Element columns are shifted by one: column 0 is the wall before node 0 (its clamp), column
    i + 1 the element from node i on, the last column the wall behind the last node. A wall's
    inverse length is zero, so that no force acts on it.

    Args:
        begin: First node that bends: 0 if the start is clamped, else 1.
        end: One past the last.
        tangent: (3, elements + 2).
        inverse: Inverse lengths (elements + 2,) [1/m].
        director: Reference directors (3, elements + 2).
        angle: Material angles theta (elements + 2,) [rad].
        own_twist: Twist of the reference frames (nodes,) [rad].
        length: Voronoi lengths of the nodes (nodes,) [m].
        natural: Integrated natural curvatures and twist (3, nodes).
        bending: EI [N m^2].
        torsion: GJ [N m^2].
        lag: Viscosity [s] over the step [s]: what bending moments take of a change
            of curvature since the last call.
        force: What each element passes on (3, elements + 2) [N], added to.
        torque: On the material angles (elements + 2,) [N m], added to.
        curvature: Integrated curvatures and twist (3, nodes) at the last call, filled anew.
    """
    energy = 0.0
    lost = 0.0
    m = np.empty((3, 2))
    n = np.empty((3, 2))
    for i in range(begin, end):
        a, b = i, i + 1
        for side in range(2):
            e = i + side
            c, s = math.cos(angle[e]), math.sin(angle[e])
            dx, dy, dz = director[0, e], director[1, e], director[2, e]
            tx, ty, tz = tangent[0, e], tangent[1, e], tangent[2, e]
            ux, uy, uz = ty * dz - tz * dy, tz * dx - tx * dz, tx * dy - ty * dx
            m[0, side], m[1, side], m[2, side] = c * dx + s * ux, c * dy + s * uy, c * dz + s * uz
            n[0, side], n[1, side], n[2, side] = c * ux - s * dx, c * uy - s * dy, c * uz - s * dz
        px, py, pz = tangent[0, a], tangent[1, a], tangent[2, a]
        qx, qy, qz = tangent[0, b], tangent[1, b], tangent[2, b]
        chi = 1.0 / (1.0 + px * qx + py * qy + pz * qz)
        kx = 2.0 * chi * (py * qz - pz * qy)
        ky = 2.0 * chi * (pz * qx - px * qz)
        kz = 2.0 * chi * (px * qy - py * qx)
        nx, ny, nz = n[0, 0] + n[0, 1], n[1, 0] + n[1, 1], n[2, 0] + n[2, 1]
        mx, my, mz = m[0, 0] + m[0, 1], m[1, 0] + m[1, 1], m[2, 0] + m[2, 1]
        k1 = 0.5 * (kx * nx + ky * ny + kz * nz)
        k2 = -0.5 * (kx * mx + ky * my + kz * mz)
        turn = angle[b] - angle[a] + own_twist[i]
        r1, r2 = k1 - curvature[0, i], k2 - curvature[1, i]
        curvature[0, i], curvature[1, i], curvature[2, i] = k1, k2, turn
        per = 1.0 / length[i]
        d1, d2, dt = k1 - natural[0, i], k2 - natural[1, i], turn - natural[2, i]
        energy += 0.5 * per * (bending * (d1 * d1 + d2 * d2) + torsion * dt * dt)
        lost += lag * per * bending * (r1 * r1 + r2 * r2)
        g1 = bending * per * (d1 + lag * r1)
        g2 = bending * per * (d2 + lag * r2)
        gt = torsion * per * dt
        sx, sy, sz = (px + qx) * chi, (py + qy) * chi, (pz + qz) * chi
        wx = chi * (g1 * nx - g2 * mx)
        wy = chi * (g1 * ny - g2 * my)
        wz = chi * (g1 * nz - g2 * mz)
        both = g1 * k1 + g2 * k2
        ia, ib = inverse[a], inverse[b]
        force[0, a] += ia * (-both * sx + qy * wz - qz * wy + 0.5 * gt * kx)
        force[1, a] += ia * (-both * sy + qz * wx - qx * wz + 0.5 * gt * ky)
        force[2, a] += ia * (-both * sz + qx * wy - qy * wx + 0.5 * gt * kz)
        force[0, b] += ib * (-both * sx - py * wz + pz * wy + 0.5 * gt * kx)
        force[1, b] += ib * (-both * sy - pz * wx + px * wz + 0.5 * gt * ky)
        force[2, b] += ib * (-both * sz - px * wy + py * wx + 0.5 * gt * kz)
        for side in range(2):
            along1 = kx * m[0, side] + ky * m[1, side] + kz * m[2, side]
            along2 = kx * n[0, side] + ky * n[1, side] + kz * n[2, side]
            torque[i + side] += 0.5 * (g1 * along1 + g2 * along2)
        torque[a] += gt
        torque[b] -= gt
    return energy, lost
