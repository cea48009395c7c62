"""Contact with a turning rigid cylinder about the z axis: penalty, Coulomb, stick with memory."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.compile import kernel
from cable_fem_node.points import (
    LOSS_CONTACT,
    LOSS_FRICTION,
    WORK_SURFACE,
    ContactLaw,
    Points,
)

FloatArray = NDArray[np.float64]


@kernel
def touch_cylinder(
    begin: int,
    end: int,
    dt: float,
    turned: float,
    turning: float,
    landing: float,
    points: Points,
    net: FloatArray,
    couple: FloatArray,
    k: ContactLaw,
    ledger: FloatArray,
    rolling: bool,
) -> None:
    """Add the cylinder's push and friction to the net forces of nodes.

    Normal penalty with dashpot; a stick spring per node that remembers how far the node has
    moved over the turning surface, cut back to Coulomb's limit (return mapping).

    Args:
        begin: First node that may touch.
        end: One past the last.
        dt: Step [s].
        turned: Rotation of the cylinder in the step before [rad].
        turning: Rotation in the step that follows [rad].
        landing: Radius at which a free node touches [m].
        points: State; stick springs and contact flags are changed.
        net: Net forces (3, nodes) [N], added to.
        couple: Friction's torque about the cable's axis (nodes,) [N m], set.
        k: Constants of the contact.
        ledger: Energies, added to.
        rolling: Whether the cable may roll about its axis.
    """
    x, v, slip, roll = points.position, points.velocity, points.slip, points.roll
    touching, contact_radius = points.touching, points.contact_radius
    per_stick = 1.0 / k.stick_stiffness
    dashpot = k.stick_damping / dt
    work = 0.0
    sliding = 0.0
    bouncing = 0.0
    for i in range(begin, end):
        px, py = x[0, i], x[1, i]
        held = touching[i] == 1
        reach = contact_radius[i] if held else landing
        square = px * px + py * py
        if square < reach * reach:
            radius = math.sqrt(square)
            inverse = 1.0 / radius
            nx, ny = px * inverse, py * inverse
            vx, vy = v[0, i], v[1, i]
            inward = -(vx * nx + vy * ny)
            elastic = k.normal_stiffness * (reach - radius)
            normal = max(elastic + k.normal_damping * inward, 0.0)
            if held:
                moved = (vy * nx - vx * ny) * dt - turned * radius
                aside = v[2, i] * dt
                if rolling:
                    aside -= k.cable_radius * roll[1, i] * dt
                slip_t = slip[0, i] + moved
                slip_z = slip[1, i] + aside
            else:
                touching[i] = 1
                contact_radius[i] = landing
                moved = aside = slip_t = slip_z = 0.0
            ft = -k.stick_stiffness * slip_t
            fz = -k.stick_stiffness * slip_z
            most = k.friction * normal
            size = ft * ft + fz * fz
            if size > most * most:
                size = math.sqrt(size)
                scale = most / size
                # What moved against the spring and is not stored in it any more has become heat.
                way = moved * moved + aside * aside
                sliding += 0.5 * (size * size - most * most) * per_stick
                sliding -= 0.5 * k.stick_stiffness * way
                ft *= scale
                fz *= scale
                slip_t *= scale
                slip_z *= scale
            else:
                ft -= dashpot * moved
                fz -= dashpot * aside
                sliding += dashpot * (moved * moved + aside * aside)
            slip[0, i] = slip_t
            slip[1, i] = slip_z
            bouncing += (normal - elastic) * inward
            work += ft * radius
            net[0, i] += normal * nx - ft * ny
            net[1, i] += normal * ny + ft * nx
            net[2, i] += fz
            couple[i] = -fz * k.cable_radius
        elif held:
            couple[i] = 0.0
            touching[i] = 0
            sliding += 0.5 * k.stick_stiffness * (slip[0, i] ** 2 + slip[1, i] ** 2)
            slip[0, i] = 0.0
            slip[1, i] = 0.0
    ledger[WORK_SURFACE] += work * turning
    ledger[LOSS_FRICTION] += sliding
    ledger[LOSS_CONTACT] += bouncing * dt
