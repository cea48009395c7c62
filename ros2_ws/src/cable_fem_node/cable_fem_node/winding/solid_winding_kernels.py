"""Steps of a solid cable between the turning cylinder, the guide's eye and the dead weight."""

import math
from typing import NamedTuple

import numpy as np

from cable_fem_node.dynamics.compile import called, kernel
from cable_fem_node.dynamics.contact_kernels import touch_cylinder
from cable_fem_node.dynamics.state import (
    LOSS_DAMPING,
    LOSS_FRICTION,
    WORK_INFLOW,
    WORK_SPAN,
    WORK_SURFACE,
    WORK_TIE,
    ContactLaw,
    FloatArray,
    Points,
    Surface,
)
from cable_fem_node.rod.rod_records import ANGLE, FEED, GUIDE, SPEED, TENSION
from cable_fem_node.solid.hex_kernels import HexMesh, hex_forces
from cable_fem_node.winding.winding_kernels import hermite

DONE, INSIDE_OUT, RAN_OUT = range(3)  # Why an advance ended

# Rows of the report: energies [J] after the last step, and the section at the eye.
STRAIN, HOURGLASS, KINETIC, SPRINGS, EYE = range(5)
REPORT_SIZE = 5


class Machine(NamedTuple):
    """Constants of the machine around a solid cable (SI)."""

    per_section: int
    sections: int
    free_length: float
    contact_line: float
    landing: float
    eye_stiffness: float
    damping_rate: float
    first: FloatArray  # (3, per_section) nodes of section 0 at cylinder angle zero
    rolling: bool  # whether friction acts on nodes, so that the cable may roll, or on sections


class SolidScratch(NamedTuple):
    """What a solid cable keeps between calls beside its nodes."""

    net: FloatArray  # (3, nodes) forces [N]
    couple: FloatArray  # (nodes,) [N m]
    grip: FloatArray  # (3, sections), see `hold_sections`
    report: FloatArray  # (REPORT_SIZE,) rows STRAIN .. EYE


class SolidAdvance(NamedTuple):
    """How an advance of the solid ended."""

    status: int  # DONE .. RAN_OUT
    at: int  # element or section at fault
    surface_step: float  # rotation of the cylinder in the last step [rad]


@called
def middle_of(section: int, per: int, position: FloatArray, out: FloatArray) -> None:
    """Fill the mean position (3,) of a section's nodes."""
    begin = section * per
    for c in range(3):
        total = 0.0
        for i in range(begin, begin + per):
            total += position[c, i]
        out[c] = total / per


@called
def hold_sections(
    dt: float,
    turned: float,
    turning: float,
    points: Points,
    mass: FloatArray,
    net: FloatArray,
    m: Machine,
    touch: ContactLaw,
    grip: FloatArray,
    ledger: FloatArray,
) -> None:
    """Add friction that acts on whole sections, as on a rod's centreline: no couple, no rolling.

    `grip` (3, sections) holds each section's stick spring, along the circumference and z, and
    whether it touched before; the normal force is that of the section's nodes.
    """
    x, v = points.position, points.velocity
    per = m.per_section
    surface = math.sin(turned)  # as in `touch_cylinder`
    work = 0.0
    heat = 0.0
    for s in range(1, m.sections):
        begin = s * per
        normal = 0.0
        for i in range(begin, begin + per):
            if points.touching[i] == 1:
                radius = math.sqrt(x[0, i] ** 2 + x[1, i] ** 2)
                normal += touch.normal_stiffness * max(points.contact_radius[i] - radius, 0.0)
        stiffness = 2.0 * touch.stick_stiffness
        if normal == 0.0:
            heat += 0.5 * stiffness * (grip[0, s] ** 2 + grip[1, s] ** 2)
            grip[0, s] = grip[1, s] = grip[2, s] = 0.0
            continue
        weight, px, py, vx, vy, vz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(begin, begin + per):
            weight += mass[i]
            px += mass[i] * x[0, i]
            py += mass[i] * x[1, i]
            vx += mass[i] * v[0, i]
            vy += mass[i] * v[1, i]
            vz += mass[i] * v[2, i]
        px, py, vx, vy, vz = px / weight, py / weight, vx / weight, vy / weight, vz / weight
        radius = math.sqrt(px * px + py * py)
        nx, ny = px / radius, py / radius
        moved, aside = 0.0, 0.0
        if grip[2, s] > 0.0:
            moved = (vy * nx - vx * ny) * dt - surface * radius
            aside = vz * dt
        grip[2, s] = 1.0
        along, across = grip[0, s] + moved, grip[1, s] + aside
        most = touch.friction * normal
        size = stiffness * math.sqrt(along * along + across * across)
        if size > most:
            scale = most / size
            heat += 0.5 * (size * size - most * most) / stiffness
            heat -= 0.5 * stiffness * (moved * moved + aside * aside)
            along *= scale
            across *= scale
        grip[0, s], grip[1, s] = along, across
        ft, fz = -stiffness * along, -stiffness * across
        work += ft * radius
        for i in range(begin, begin + per):
            share = mass[i] / weight
            net[0, i] -= share * ft * ny
            net[1, i] += share * ft * nx
            net[2, i] += share * fz
    ledger[WORK_SURFACE] += work * turning
    ledger[LOSS_FRICTION] += heat


@kernel
def advance_solid_winding(
    steps: int,
    dt: float,
    surface_step: float,
    drive: FloatArray,
    points: Points,
    mesh: HexMesh,
    mass: FloatArray,
    m: Machine,
    touch: ContactLaw,
    nodal: ContactLaw,
    scratch: SolidScratch,
    ledger: FloatArray,
) -> tuple[int, int, float]:
    """Advance by equal steps while the drive runs from its first to its second column.

    Returns the fields of `SolidAdvance`, see `advance_winding`.

    Args:
        steps: Number of steps to take.
        dt: Step [s].
        surface_step: Rotation of the cylinder in the step before the first [rad].
        drive: Shape (7, 2), rows ANGLE .. LANDING.
        points: Of the solid, changed.
        mesh: Of the solid.
        mass: Of the nodes (nodes,) [kg].
        m: Constants of the machine.
        touch: Constants of the contact.
        nodal: Of single nodes; without friction where that acts on whole sections.
        scratch: Forces, grips and report, changed.
        ledger: Energies [J], added to.
    """
    net, couple, grip, report = scratch.net, scratch.couple, scratch.grip, scratch.report
    x, v = points.position, points.velocity
    nodes = net.shape[1]
    per = m.per_section
    span = steps * dt
    angle = drive[ANGLE, 0]
    guide = drive[GUIDE, 0]
    low, high, tail = np.empty(3), np.empty(3), np.empty(3)
    eye = int(report[EYE])
    tail_begin = (m.sections - 1) * per
    tail_mass = 0.0
    for i in range(tail_begin, nodes):
        tail_mass += mass[i]
    half = 0.5 * m.damping_rate * dt
    decay = (1.0 - half) / (1.0 + half)
    for step in range(steps):
        share = (step + 1.0) / steps
        next_angle = hermite(
            drive[ANGLE, 0], drive[ANGLE, 1], drive[SPEED, 0] * span, drive[SPEED, 1] * span, share
        )
        next_guide = hermite(
            drive[GUIDE, 0], drive[GUIDE, 1], drive[FEED, 0] * span, drive[FEED, 1] * span, share
        )
        pull = drive[TENSION, 0] + step / steps * (drive[TENSION, 1] - drive[TENSION, 0])
        rotation = next_angle - angle
        rate = rotation / dt
        guide_speed = (next_guide - guide) / dt
        at, stored, wavy, lost = hex_forces(x, v, mesh, True, net)
        if at >= 0:
            return INSIDE_OUT, at, surface_step
        surface = Surface(
            turned=surface_step,
            turning=rotation,
            landing=m.landing,
            rolling=False,
            edge=nodes,
            gripped=nodes,
        )
        touch_cylinder(per, nodes, dt, surface, points, mass, net, couple, nodal, ledger)
        if not m.rolling:
            hold_sections(dt, surface_step, rotation, points, mass, net, m, touch, grip, ledger)
        # The eye holds the point of the cable that is at the guide; the weight's pulley its end.
        middle_of(eye + 1, per, x, high)
        while high[1] > -m.free_length:
            eye += 1
            if eye + 2 >= m.sections:
                return RAN_OUT, eye, surface_step
            middle_of(eye + 1, per, x, high)
        middle_of(eye, per, x, low)
        middle_of(m.sections - 1, per, x, tail)
        weight = (-m.free_length - low[1]) / (high[1] - low[1])
        springs = 0.0
        for c in (0, 2):
            target = m.contact_line if c == 0 else guide
            moves = 0.0 if c == 0 else guide_speed
            gap = (1.0 - weight) * low[c] + weight * high[c] - target
            end_gap = tail[c] - target
            force = -m.eye_stiffness * gap / per
            end_force = -m.eye_stiffness * end_gap / per
            # Along a slanting cable the eye slips: its force stands across the cable.
            slant = -force * (high[c] - low[c]) / (high[1] - low[1])
            for i in range(per):
                net[c, eye * per + i] += (1.0 - weight) * force
                net[c, (eye + 1) * per + i] += weight * force
                net[1, eye * per + i] += (1.0 - weight) * slant
                net[1, (eye + 1) * per + i] += weight * slant
                net[c, tail_begin + i] += end_force
            springs += 0.5 * m.eye_stiffness * (gap * gap + end_gap * end_gap)
            ledger[WORK_INFLOW] -= m.eye_stiffness * (gap + end_gap) * moves * dt
        laid = 0
        for i in range(nodes - 1, per - 1, -1):
            if points.touching[i] == 1:
                laid = i // per
                break
        kinetic = 0.0
        damping = 0.0
        dropped = 0.0
        for i in range(per, nodes):
            px, py = x[0, i], x[1, i]
            if i // per <= laid:
                rx, ry, rz = -rate * py, rate * px, 0.0
            else:
                rx, ry = 0.0, m.contact_line * rate
                rz = guide_speed * min(1.0, max(0.0, -py / m.free_length))
            fy = net[1, i]
            if i >= tail_begin:
                given = -pull * mass[i] / tail_mass
                fy += given
                dropped += given * v[1, i]
            push = dt / (mass[i] * (1.0 + half))
            wx, wy, wz = v[0, i] - rx, v[1, i] - ry, v[2, i] - rz
            ux = wx * decay + push * net[0, i]
            uy = wy * decay + push * fy
            uz = wz * decay + push * net[2, i]
            ax, ay, az = 0.5 * (ux + wx), 0.5 * (uy + wy), 0.5 * (uz + wz)
            damping += mass[i] * (ax * (ax + rx) + ay * (ay + ry) + az * (az + rz))
            v[0, i], v[1, i], v[2, i] = ux + rx, uy + ry, uz + rz
            kinetic += mass[i] * (v[0, i] ** 2 + v[1, i] ** 2 + v[2, i] ** 2)
            x[0, i] = px + dt * v[0, i]
            x[1, i] = py + dt * v[1, i]
            x[2, i] += dt * v[2, i]
        ledger[LOSS_DAMPING] += dt * (m.damping_rate * damping + lost)
        ledger[WORK_SPAN] += dt * dropped
        cosine, sine = math.cos(next_angle), math.sin(next_angle)
        work = 0.0
        for i in range(per):
            nx = cosine * m.first[0, i] - sine * m.first[1, i]
            ny = sine * m.first[0, i] + cosine * m.first[1, i]
            work -= net[0, i] * (nx - x[0, i]) + net[1, i] * (ny - x[1, i])
            v[0, i], v[1, i] = (nx - x[0, i]) / dt, (ny - x[1, i]) / dt
            x[0, i], x[1, i] = nx, ny
        ledger[WORK_TIE] += work
        angle, guide = next_angle, next_guide
        surface_step = rotation
        report[STRAIN], report[HOURGLASS] = stored, wavy
        report[KINETIC], report[SPRINGS] = 0.5 * kinetic, springs
    report[EYE] = eye
    if not math.isfinite(report[KINETIC]):
        return INSIDE_OUT, 0, surface_step
    return DONE, 0, surface_step
