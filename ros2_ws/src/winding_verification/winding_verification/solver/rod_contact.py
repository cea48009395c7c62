"""Rods on the rigid cylinder: capstan, stored tension, sliding, drape."""

import math

import numpy as np

from cable_fem_node.dynamics.state import CylinderContact
from cable_fem_node.winding.resolved_model import chord_radius
from winding_verification.rod.rod import Rod, RodSection
from winding_verification.solver.rods import GRAVITY, line
from winding_verification.solver.suite import Values

LIMP = 1.0e-3


def wrapped(
    section: RodSection, radius: float, wrap: float, tail: int, tension: float, per: float
) -> tuple[Rod, float]:
    """Return a stretched rod over a cylinder and the radius of its nodes.

    It comes from the -y side to azimuth 0, goes round by `wrap` and leaves straight; both tails
    have `tail` elements.

    Args:
        section: Of the rod.
        radius: Centreline radius on the cylinder [m].
        wrap: Angle in contact [rad].
        tail: Elements on either side.
        tension: [N]
        per: Length of an element [m], about.
    """
    count = max(2, round(radius * wrap / per))
    angle = wrap / count
    reach = chord_radius(radius, radius * angle)
    theta = angle * np.arange(count + 1)
    arc = reach * np.stack([np.cos(theta), np.sin(theta)], axis=1)
    step = radius * angle
    low = arc[0] + step * np.arange(tail, 0, -1)[:, None] * np.array([0.0, -1.0])
    leave = np.array([-math.sin(wrap), math.cos(wrap)])
    high = arc[-1] + step * np.arange(1, tail + 1)[:, None] * leave
    plane = np.vstack([low, arc, high])
    nodes = np.column_stack([plane, np.zeros(plane.shape[0])])
    lengths = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
    stretch = section.uniaxial.stretch_at(tension / section.area)
    rod = Rod(nodes, section, reference=lengths / stretch)
    rod.fix(range(nodes.shape[0]), "z")
    return rod, reach


def capstan() -> Values:
    """C01: a limp cable dragged over the cylinder: T_high / T_low = exp(mu beta)."""
    names = {0.5: "ratio_0.5pi", 1.0: "ratio_1pi", 1.5: "ratio_1.5pi", 2.0: "ratio_2pi"}
    section = RodSection(diameter=2.0e-3, bending_factor=LIMP)
    values: Values = {}
    for turns, name in names.items():
        wrap, tail = turns * math.pi, 15
        rod, reach = wrapped(section, 0.016, wrap, tail, 0.1, 1.0e-3)
        last = rod.mass.size - 1
        rod.touch(CylinderContact(reach=reach, friction=0.1))
        rod.apply(0, (0.0, -0.1, 0.0))
        rod.fix(0, "x")
        rod.drive(last, 0.02 * np.array([-math.sin(wrap), math.cos(wrap), 0.0]))
        rod.damping_rate = 60.0
        rod.advance(0.1)
        pulls = []
        for _ in range(50):
            rod.advance(2.0e-3)
            tension = rod.tension()
            pulls.append((tension[3 : tail - 7].mean(), tension[-(tail - 7) : -3].mean()))
        low, high = np.mean(pulls, axis=0)
        values[name] = high / low
    return values


def atwood() -> Values:
    """C03: two weights over the fixed cylinder stick below exp(mu pi), slide above it."""
    return {f"acceleration_{10.0 * heavy:g}": _atwood(0.1, heavy) for heavy in (0.12, 0.125, 0.16)}


def stored_tension() -> Values:
    """C05: a load raised after winding slips forward by ln(T2 / T1) / mu."""
    section = RodSection(diameter=2.0e-3, bending_factor=LIMP)
    laid, raised, wrap, tail = 1.962, 3.924, 12.0, 10
    rod, reach = wrapped(section, 0.016, wrap, tail, laid, 1.5e-3)
    count = rod.mass.size
    inner = np.arange(count - tail - 1)
    rod.fix(inner[:11])
    rod.touch(CylinderContact(reach=reach, friction=0.1))
    away = np.array([-math.sin(wrap), math.cos(wrap), 0.0])
    rod.apply(count - 1, raised * away)
    rod.damping_rate = 80.0
    rod.ramp_loads([0.0, 0.05, 0.65], [laid / raised, laid / raised, 1.0])
    rod.advance(0.75)
    tension = rod.tension()
    middle = 0.5 * (rod.nodes[1:] + rod.nodes[:-1])
    azimuth = np.unwrap(np.arctan2(middle[:, 1], middle[:, 0]))
    behind = wrap - azimuth[10:-tail]
    on_drum = tension[10:-tail]
    order = np.argsort(behind)
    values: Values = {
        f"tension_{at:g}": float(np.interp(at, behind[order], on_drum[order]))
        for at in (0.0, 2.0, 4.0, 6.0, 8.0, 10.0)
    }
    far = on_drum[(behind > 9.0) & (behind < 11.0)].mean()
    slipped = behind[np.abs(on_drum / far - 1.0) > 0.02]
    values["slip_zone"] = float(slipped.max()) + math.log(1.02) / 0.1
    return values


def normal_force() -> Values:
    """C06: a frictionless half turn presses with 2 T, T / (R + r) per length in its middle."""
    section = RodSection(diameter=4.0e-3, bending_factor=LIMP)
    radius, pull = 0.032, 1.962
    rod, reach = wrapped(section, radius, math.pi, 10, pull, 2.0e-3)
    last = rod.mass.size - 1
    rod.touch(CylinderContact(reach=reach, friction=0.0))
    rod.apply([0], (0.0, -pull, 0.0))
    rod.apply([last], (0.0, -pull, 0.0))
    rod.fix([0, last], "x")
    rod.damping_rate = 100.0
    rod.advance(0.4)
    normal = rod.contact_forces()
    place = rod.nodes
    azimuth = np.arctan2(place[:, 1], place[:, 0])
    mid = np.abs(azimuth - 0.5 * math.pi) < 0.3
    lengths = 0.5 * (rod.lengths()[1:] + rod.lengths()[:-1])
    line_load = float((normal[1:-1][mid[1:-1]] / lengths[mid[1:-1]]).mean())
    return {
        "resultant": float((normal * np.sin(azimuth)).sum()),
        "line_load": line_load,
        "line_load_surface": line_load * radius / 0.03,
    }


def sliding() -> Values:
    """C09: a rod slides along a very large cylinder and stops."""
    section = RodSection(diameter=4.0e-3)
    big, elements = 100.0, 40
    nodes = line(0.1, elements, 2) + np.array([big, 0.0, 0.0])
    rod = Rod(nodes, section)
    rod.gravity[:] = (-GRAVITY, 0.0, 0.0)
    rod.touch(CylinderContact(reach=big, friction=0.1))
    sink = rod.mass * GRAVITY / rod.contact_stiffness()
    nodes[:, 0] -= sink
    rod.set_nodes(nodes)
    rod.set_velocities(np.tile([0.0, 0.0, 0.05], (elements + 1, 1)))
    start = rod.nodes[:, 2].mean()
    moving = 0.5 * rod.mass.sum() * 0.05**2
    stopped = 0.0
    for _ in range(800):
        rod.advance(1.0e-4)
        if rod.velocities[:, 2].mean() > 1.0e-4:
            stopped = rod.time
    way = rod.nodes[:, 2].mean() - start
    heat = rod.energy.friction
    # The rod's own axial vibration dies out first.
    rod.advance(0.2)
    before = rod.nodes[:, 2].mean()
    rod.advance(0.2)
    return {
        "time": stopped,
        "distance": float(way),
        "creep": abs(float(rod.nodes[:, 2].mean() - before)) / 0.2,
        "friction_over_kinetic": heat / moving,
    }


def drape() -> Values:
    """D08 (rod): a rod over a frictionless cylinder, loaded at its end."""
    section = RodSection(diameter=4.0e-3, law="neo_hookean")
    length, elements, pull = 0.06, 120, 1.962
    law = section.uniaxial
    stretch = law.stretch_at(pull / section.area)
    radius = 0.015 + 0.002 * float(law.lateral_stretch(stretch))
    step = stretch * length / elements
    reach = chord_radius(radius, step)
    # Laid out along a quarter circle, then straight down; the symmetry plane is the start.
    turn = step / radius
    nodes = np.zeros((elements + 1, 3))
    for i in range(elements + 1):
        bent = min(turn * i, 0.5 * math.pi)
        nodes[i, :2] = reach * math.sin(bent), reach * math.cos(bent)
        nodes[i, 1] -= step * max(0.0, i - 0.5 * math.pi / turn)
    rod = Rod(nodes, section, reference=np.full(elements, length / elements))
    rod.fix(range(elements + 1), "z")
    rod.clamp("start", (1.0, 0.0, 0.0))
    rod.release(0, "y")
    rod.touch(CylinderContact(reach=reach, friction=0.0))
    rod.apply(elements, (0.0, -pull, 0.0))
    rod.settle(2.0e-4)
    tension = rod.tension()
    place = rod.nodes
    azimuth = np.arctan2(place[:, 0], place[:, 1])
    inside = slice(10, 30)
    rate = np.diff(azimuth)[inside].mean() * elements / length
    touching = np.flatnonzero(rod.touching)
    return {
        "tension": float(tension[inside].mean()),
        "lift_off": 0.5 * math.pi - float(azimuth[touching[-1]]),
        "theta_rate": float(rate),
        "tip_x": place[-1, 0],
        "tip_y": place[-1, 1],
    }


def _atwood(light: float, heavy: float) -> float:
    section = RodSection(diameter=1.0e-3, young=6.4e8, bending_factor=LIMP * 0.1, density=5.0e3)
    rod, reach = wrapped(section, 0.0155, math.pi, 20, light * GRAVITY, 1.0e-3)
    last = rod.mass.size - 1
    rod.mass[[0, last]] += light, heavy
    rod.fix([0, last], "x")
    rod.touch(CylinderContact(reach=reach, friction=0.1))
    rod.load[1, 0] = -light * GRAVITY
    rod.load[1, last] = -heavy * GRAVITY
    start = rod.nodes[[0, last], 1]
    times, ways = 0.002 * np.arange(1, 61), []
    for _ in times:
        rod.advance(0.002)
        moved = rod.nodes[[0, last], 1] - start
        ways.append(0.5 * (moved[0] - moved[1]))
    # The cable's elastic swing about the motion is averaged out by the fit.
    return float(2.0 * np.polyfit(times, ways, 2)[0])
