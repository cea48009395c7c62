"""Forces and explicit steps of the general rod model."""

from __future__ import annotations

import math
from typing import NamedTuple

from cable_fem_node.dynamics.compile import kernel
from cable_fem_node.dynamics.motion_kernels import BoundaryConditions, amplitude_at, move
from cable_fem_node.dynamics.state import (
    LOSS_DAMPING,
    WORK_SPAN,
    ContactLaw,
    FloatArray,
    Points,
)
from cable_fem_node.rod.rod_kernels import bend_end, bend_nodes, element_force, stretch_elements
from cable_fem_node.rod.rod_records import AxialResponse, Work
from winding_core.material_law import TABLE_HIGH, TABLE_LOW
from winding_verification.rod.frame_kernels import carry_frames, frame_forces, reference_twist


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
    """Frames (state) and scratch; element columns of frames are shifted by one."""

    director: FloatArray  # (3, elements + 2)
    carried: FloatArray  # (3, elements + 2) tangents the directors belong to
    angle: FloatArray  # (elements + 2,) theta
    spin: FloatArray  # (elements + 2,) its rate
    own_twist: FloatArray  # (nodes,)
    curvature: FloatArray  # (3, nodes)
    work: Work
    walled: FloatArray  # (3, elements + 2)
    walled_inverse: FloatArray
    walled_force: FloatArray
    torque: FloatArray


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
    for i in range(nodes):
        w.cosine[i] = 0.0
        w.slope[i] = 0.0
    if mesh.framed:
        element_force(elements, ends.first, ends.last, w)
        for c in range(3):
            s.walled[c, 0] = ends.first[c]
            s.walled[c, elements + 1] = ends.last[c]
            for i in range(elements):
                s.walled[c, i + 1] = w.tangent[c, i]
            for i in range(elements + 2):
                s.walled_force[c, i] = 0.0
        for i in range(elements):
            s.walled_inverse[i + 1] = w.inverse[i]
        s.walled_inverse[0] = 0.0
        s.walled_inverse[elements + 1] = 0.0
        for i in range(elements + 2):
            s.torque[i] = 0.0
        carry_frames(elements + 2, s.walled, s.carried, s.director)
        reference_twist(elements, s.walled, s.director, s.own_twist)
        energy, lost = frame_forces(
            0 if ends.clamped[0] > 0.0 else 1, nodes if ends.clamped[1] > 0.0 else elements,
            s.walled, s.walled_inverse, s.director, s.angle, s.own_twist, mesh.voronoi,
            mesh.natural, mesh.bending, mesh.torsion, lag, s.walled_force, s.torque, s.curvature,
        )  # fmt: skip
        for c in range(3):
            for i in range(elements):
                w.force[c, i] += s.walled_force[c, i + 1]
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
        e = 0 if side == 0 else elements - 1
        mx, my, mz = ends.moment[0, side], ends.moment[1, side], ends.moment[2, side]
        tx, ty, tz = w.tangent[0, e], w.tangent[1, e], w.tangent[2, e]
        inv = w.inverse[e] * load_factor
        w.force[0, e] -= inv * (my * tz - mz * ty)
        w.force[1, e] -= inv * (mz * tx - mx * tz)
        w.force[2, e] -= inv * (mx * ty - my * tx)
        if mesh.framed:
            s.torque[e + 1] += load_factor * (mx * tx + my * ty + mz * tz)
    for c in range(3):
        w.net[c, 0] = w.force[c, 0]
        w.net[c, elements] = -w.force[c, elements - 1]
        for i in range(1, elements):
            w.net[c, i] = w.force[c, i] - w.force[c, i - 1]
    return energy, lost


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
            e = 0 if side == 0 else elements - 1
            mx, my, mz = ends.moment[0, side], ends.moment[1, side], ends.moment[2, side]
            tx, ty, tz = work.tangent[0, e], work.tangent[1, e], work.tangent[2, e]
            inv = factor * work.inverse[e] * dt
            v = points.velocity
            ledger[WORK_SPAN] += inv * (
                (my * tz - mz * ty) * (v[0, e + 1] - v[0, e])
                + (mz * tx - mx * tz) * (v[1, e + 1] - v[1, e])
                + (mx * ty - my * tx) * (v[2, e + 1] - v[2, e])
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
