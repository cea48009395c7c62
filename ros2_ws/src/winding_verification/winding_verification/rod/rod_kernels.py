"""Forces and explicit steps of the general rod model.

Bending and twist of rods with material frames follow discrete elastic rods (Bergou et al. 2008,
2010): every element carries a reference frame that is parallel transported in time and a material
angle theta against it; curvature and twist count against natural values. Isotropic section: one
EI, one GJ. Curvature binormal at a node between tangents t, u: kb = 2 t x u / (1 + t.u), so a
circle of chords l has |kb| = 2 tan(phi / 2).
"""

import math
from typing import NamedTuple

import numpy as np

from cable_fem_node.dynamics.compile import called, kernel
from cable_fem_node.dynamics.motion_kernels import BoundaryConditions, amplitude_at, move
from cable_fem_node.dynamics.state import LOSS_DAMPING, WORK_SPAN, ContactLaw, FloatArray, Points
from cable_fem_node.rod.rod_kernels import bend_end, bend_nodes, element_force, stretch_elements
from cable_fem_node.rod.rod_records import AxialResponse, Work
from winding_core.cable.material_law import TABLE_HIGH, TABLE_LOW


class RodMesh(NamedTuple):
    """What a rod is made of."""

    reference: FloatArray  # (elements,) [m]
    voronoi: FloatArray  # (nodes,) [m]
    natural: FloatArray  # (3, nodes) integrated natural curvatures and twist
    response: AxialResponse
    bending: float
    torsion: float
    spin_inertia: FloatArray  # (elements,) [kg m^2]
    framed: bool


class RodEnds(NamedTuple):
    """Clamps and end moments of a rod."""

    clamped: FloatArray  # (2,)
    first: FloatArray  # (3,) direction of the start's clamp
    last: FloatArray  # (3,) direction of the end's clamp
    moment: FloatArray  # (3, 2) at the start, at the end [N m] at amplitude one
    spin_free: FloatArray  # (elements + 2,) 1 where theta is free


class RodScratch(NamedTuple):
    """Frames (state) and scratch; element columns of frames are shifted by one.

    Column 0 is the wall before node 0 (its clamp), column i + 1 the element from node i on, the
    last column the wall behind the last node. A wall's inverse length is zero, so that no force
    acts on it.
    """

    director: FloatArray  # (3, elements + 2) reference directors
    carried: FloatArray  # (3, elements + 2) tangents the directors belong to
    angle: FloatArray  # (elements + 2,) material angles theta [rad]
    spin: FloatArray  # (elements + 2,) their rates [rad/s]
    own_twist: FloatArray  # (nodes,) twist of the reference frames [rad]
    curvature: FloatArray  # (3, nodes) integrated curvatures and twist at the last call
    work: Work
    walled: FloatArray  # (3, elements + 2) tangents
    walled_inverse: FloatArray  # (elements + 2,) inverse lengths [1/m]
    walled_force: FloatArray  # (3, elements + 2) what each element passes on [N]
    torque: FloatArray  # (elements + 2,) on the material angles [N m]


@kernel
def rod_forces(
    nodes: int,
    position: FloatArray,
    mesh: RodMesh,
    ends: RodEnds,
    s: RodScratch,
    load_factor: float,
    lag: float,
) -> tuple[float, float]:
    """Fill the net internal force on every node, end moments included.

    Returns:
        of the frames the energy of bending and twist, and what viscosity took of it since the
        last call [J]; zeros for a rod without frames.

    Frames are carried to the present tangents.
    """
    elements = nodes - 1
    w = s.work
    energy = 0.0
    lost = 0.0
    stretch_elements(elements, position, mesh.reference, mesh.response, w)
    w.cosine[:nodes] = 0.0
    w.slope[:nodes] = 0.0
    if mesh.framed:
        element_force(elements, ends.first, ends.last, w)
        s.walled[:, 0] = ends.first
        s.walled[:, 1 : elements + 1] = w.tangent[:, :elements]
        s.walled[:, elements + 1] = ends.last
        s.walled_inverse[0] = 0.0
        s.walled_inverse[1 : elements + 1] = w.inverse[:elements]
        s.walled_inverse[elements + 1] = 0.0
        s.walled_force[:] = 0.0
        s.torque[:] = 0.0
        carry_frames(elements + 2, s)
        reference_twist(elements, s)
        begin = 0 if ends.clamped[0] > 0.0 else 1
        energy, lost = frame_forces(
            begin, nodes if ends.clamped[1] > 0.0 else elements, lag, mesh, s
        )
        w.force[:, :elements] += s.walled_force[:, 1 : elements + 1]
    else:
        bend_nodes(elements, mesh.reference, mesh.bending, w)
        if ends.clamped[0] > 0.0:
            bend_end(0, 0, ends.first, mesh.reference[0], mesh.bending, w)
        if ends.clamped[1] > 0.0:
            end = elements - 1
            bend_end(elements, end, ends.last, mesh.reference[end], mesh.bending, w)
        element_force(elements, ends.first, ends.last, w)
    # An end moment is a couple of forces on its element: m x t / length on the outer node.
    for side in range(2):
        e, across_x, across_y, across_z, along = end_moment(side, elements, ends, w)
        inv = w.inverse[e] * load_factor
        w.force[0, e] -= inv * across_x
        w.force[1, e] -= inv * across_y
        w.force[2, e] -= inv * across_z
        if mesh.framed:
            s.torque[e + 1] += load_factor * along
    w.net[:, 0] = w.force[:, 0]
    w.net[:, 1:elements] = w.force[:, 1:elements] - w.force[:, : elements - 1]
    w.net[:, elements] = -w.force[:, elements - 1]
    return energy, lost


@called
def end_moment(
    side: int, elements: int, ends: RodEnds, w: Work
) -> tuple[int, float, float, float, float]:
    """Return an end's element, and of its moment m [N m] there m x t and m . t."""
    e = 0 if side == 0 else elements - 1
    mx, my, mz = ends.moment[0, side], ends.moment[1, side], ends.moment[2, side]
    tx, ty, tz = w.tangent[0, e], w.tangent[1, e], w.tangent[2, e]
    along = mx * tx + my * ty + mz * tz
    return e, my * tz - mz * ty, mz * tx - mx * tz, mx * ty - my * tx, along


@kernel
def advance_rod(
    nodes: int,
    steps: int,
    dt: float,
    start: float,
    points: Points,
    mesh: RodMesh,
    ends: RodEnds,
    scratch: RodScratch,
    around: BoundaryConditions,
    touch: ContactLaw,
    viscosity: float,
    ledger: FloatArray,
) -> tuple[int, float]:
    """Advance a rod by equal steps.

    Returns:
        the element at fault or -1, the kinetic energy [J].
    """
    peak = 0.0
    kinetic = 0.0
    kick = 0.5 if around.calming else 1.0
    elements = nodes - 1
    work = scratch.work
    lag = 0.0 if around.calming else viscosity / dt
    for step in range(steps):
        t = start + step * dt
        factor = amplitude_at(t, around.load_times, around.load_values)
        _, lost = rod_forces(nodes, points.position, mesh, ends, scratch, factor, lag)
        ledger[LOSS_DAMPING] += lost
        kinetic = move(dt, kick, points, work.net, work.couple, around, factor, touch, ledger)
        for side in range(2):
            e, across_x, across_y, across_z, _ = end_moment(side, elements, ends, work)
            inv = factor * work.inverse[e] * dt
            v = points.velocity
            ledger[WORK_SPAN] += inv * (
                across_x * (v[0, e + 1] - v[0, e])
                + across_y * (v[1, e + 1] - v[1, e])
                + across_z * (v[2, e + 1] - v[2, e])
            )
        if mesh.framed:
            half = 0.5 * around.damping_rate * dt
            for i in range(elements + 2):
                spun = (
                    scratch.spin[i] * (1.0 - half)
                    + kick * dt * scratch.torque[i] / mesh.spin_inertia[i]
                ) / (1.0 + half)
                scratch.spin[i] = ends.spin_free[i] * spun
                scratch.angle[i] += dt * scratch.spin[i]
                kinetic += 0.5 * ends.spin_free[i] * mesh.spin_inertia[i] * scratch.spin[i] ** 2
        kick = 1.0
        if around.calming:
            if kinetic < peak:
                kick = 0.5
                points.velocity[:, :nodes] *= 1.0 - around.free
                scratch.spin[:] = 0.0
                peak = 0.0
            else:
                peak = kinetic
    for i in range(elements):
        stretch = 1.0 / (work.inverse[i] * mesh.reference[i])
        if not TABLE_LOW < stretch < TABLE_HIGH:
            return i, kinetic
    if not math.isfinite(kinetic):
        return 0, kinetic
    return -1, kinetic


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
def carry_frames(columns: int, s: RodScratch) -> None:
    """Bring the reference directors from the carried tangents to the new ones."""
    tangent, carried, director = s.walled, s.carried, s.director
    v = np.empty(3)
    for i in range(columns):
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
def reference_twist(elements: int, s: RodScratch) -> None:
    """Update the reference frames' own twist, without jumps of whole turns."""
    tangent, director, twist = s.walled, s.director, s.own_twist
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
    begin: int, end: int, lag: float, mesh: RodMesh, scratch: RodScratch
) -> tuple[float, float]:
    """Add bending and twisting forces; return their stored energy and what was lost [J].

    Args:
        begin: First node that bends: 0 if the start is clamped, else 1.
        end: One past the last.
        lag: Viscosity [s] over the step [s]: what bending moments take of a change
            of curvature since the last call.
        mesh: What the rod is made of.
        scratch: Frames carried to the present tangents; `walled_force` and `torque` are added to,
            `curvature` is filled anew.
    """
    tangent, director, angle = scratch.walled, scratch.director, scratch.angle
    natural, bending, torsion = mesh.natural, mesh.bending, mesh.torsion
    force, torque, curvature = scratch.walled_force, scratch.torque, scratch.curvature
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
        turn = angle[b] - angle[a] + scratch.own_twist[i]
        r1, r2 = k1 - curvature[0, i], k2 - curvature[1, i]
        curvature[0, i], curvature[1, i], curvature[2, i] = k1, k2, turn
        per = 1.0 / mesh.voronoi[i]
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
        ia, ib = scratch.walled_inverse[a], scratch.walled_inverse[b]
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
