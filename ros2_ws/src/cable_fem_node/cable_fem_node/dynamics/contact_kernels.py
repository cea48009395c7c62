"""Contact with a turning rigid cylinder about the z axis: penalty, Coulomb, stick with memory."""

from __future__ import annotations

import math

from cable_fem_node.dynamics.compile import kernel
from cable_fem_node.dynamics.state import (
    LOSS_CONTACT,
    LOSS_FRICTION,
    WORK_SURFACE,
    ContactLaw,
    FloatArray,
    Points,
    Surface,
)

# Share of its depth by which a landing node comes back in a step at most.
_RETURN = 0.25


@kernel
def touch_cylinder(
    begin: int,
    end: int,
    dt: float,
    surface: Surface,
    points: Points,
    mass: FloatArray,
    net: FloatArray,
    couple: FloatArray,
    k: ContactLaw,
    ledger: FloatArray,
) -> None:
    """Add the cylinder's push and friction to the net forces of nodes.

    Normal penalty with dashpot; a stick spring per node that remembers how far the node has
    moved over the turning surface, cut back to Coulomb's limit (return mapping).

    A force acts in both steps that meet where it is taken, so that its work needs the velocities
    before and after; the latter follows from the net force, of which contact is the last part.

    Args:
        begin: First node that may touch.
        end: One past the last.
        dt: Step [s].
        surface: Of the cylinder.
        points: State; stick springs and contact flags are changed.
        mass: Of the nodes (nodes,) [kg].
        net: Net forces (3, nodes) [N], added to.
        couple: Friction's torque about the cable's axis (nodes,) [N m], set.
        k: Constants of the contact.
        ledger: Energies [J], added to.
    """
    x, v, slip, roll = points.position, points.velocity, points.slip, points.roll
    touching, contact_radius = points.touching, points.contact_radius
    stick = k.stick_stiffness
    per_stick = 1.0 / stick
    dashpot = k.stick_damping / dt
    turned, turning, edge = surface.turned, surface.turning, surface.edge
    lever = k.cable_radius if surface.rolling else 0.0
    work = 0.0
    sliding = 0.0
    bouncing = 0.0
    square_landing = surface.landing * surface.landing
    # The chord of what turned with the surface, along the tangent at its end, over the radius. With
    # the angle itself the springs of cable that lies still would creep.
    chord = math.sin(turned)
    for i in range(begin, end):
        px, py = x[0, i], x[1, i]
        square = px * px + py * py
        held = touching[i] == 1
        if not held:
            if square >= square_landing:
                continue
            touching[i] = 1
            contact_radius[i] = surface.landing
        radius = math.sqrt(square)
        depth = contact_radius[i] - radius
        slip_t, slip_z = slip[0, i], slip[1, i]
        if depth <= 0.0:
            # A node that lifts off leaves its spring's energy behind as heat.
            sliding += 0.5 * stick * (slip_t * slip_t + slip_z * slip_z)
            touching[i] = 0
            slip[0, i] = 0.0
            slip[1, i] = 0.0
            couple[i] = 0.0
            continue
        vx, vy = v[0, i], v[1, i]
        inverse = 1.0 / radius
        nx, ny = px * inverse, py * inverse
        # The velocity is half a step old: on a turning surface it points off the tangent here. The
        # dashpot acts on the rate of the radius itself, which is zero for a node that lies still.
        outward = vx * nx + vy * ny
        inward = 0.5 * dt * (vx * vx + vy * vy) * inverse - outward
        elastic = k.normal_stiffness * depth
        normal = elastic + k.normal_damping * inward
        if i >= edge:
            off = inward + 2.0 * outward + dt / mass[i] * (net[0, i] * nx + net[1, i] * ny)
            normal = min(normal, mass[i] / dt * (_RETURN * depth / dt - off))
        normal = max(normal, 0.0)
        moved, aside = 0.0, 0.0
        if held:
            if i != edge or not surface.free or slip_t != 0.0:
                moved = (vy * nx - vx * ny) * dt - chord * radius
            aside = (v[2, i] - lever * roll[1, i]) * dt
        slip_t += moved
        slip_z += aside
        grip = 0.0
        ft, fz = -stick * slip_t, -stick * slip_z
        size = ft * ft + fz * fz
        most = k.friction * normal
        way = moved * moved + aside * aside
        if size > most * most:
            # What moved against the spring and is not stored in it any more has become heat.
            sliding += 0.5 * ((size - most * most) * per_stick - stick * way)
            scale = most / math.sqrt(size)
            ft *= scale
            fz *= scale
            slip_t *= scale
            slip_z *= scale
        else:
            grip = dashpot
            ft -= dashpot * moved
            fz -= dashpot * aside
        slip[0, i] = slip_t
        slip[1, i] = slip_z
        work += ft * radius
        net[0, i] += normal * nx - ft * ny
        net[1, i] += normal * ny + ft * nx
        net[2, i] += fz
        gained = 0.5 * dt / mass[i]
        bouncing -= (normal - elastic) * (outward + gained * (net[0, i] * nx + net[1, i] * ny))
        if grip > 0.0:
            along = gained * dt * (net[1, i] * nx - net[0, i] * ny)
            along -= 0.5 * (turning - turned) * radius
            sliding += grip * (way + moved * along + aside * gained * dt * net[2, i])
        couple[i] = -fz * lever
    ledger[WORK_SURFACE] += 0.5 * work * (turned + turning)
    ledger[LOSS_FRICTION] += sliding
    ledger[LOSS_CONTACT] += bouncing * dt
