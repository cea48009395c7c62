"""Rods at rest (elastica, curved, buckling, hanging), small vibrations, rods in motion."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.optimize import root_scalar

from cable_fem_node.dynamics.state import FloatArray
from winding_core.units import MILLIMETRE
from winding_verification.rod.rod import Rod, RodSection
from winding_verification.rod.statics import equilibrium, frequencies, lowest_stiffness
from winding_verification.solver.suite import Values, rotations, wave_record

GRAVITY = 9.81


def line(length: float, elements: int, axis: int = 0) -> FloatArray:
    """Return the nodes of a straight rod from the origin, shape (elements + 1, 3)."""
    nodes = np.zeros((elements + 1, 3))
    nodes[:, axis] = np.linspace(0.0, length, elements + 1)
    return nodes


def axial_frequencies() -> Values:
    """B01: bar fixed at one end."""
    rod = Rod(line(0.1, 50), RodSection(diameter=4.0e-3))
    rod.fix(range(51), "yz")
    rod.fix(0)
    f = frequencies(rod, 3)
    speed = math.sqrt(rod.section.young / rod.section.density)
    return {"wave_speed": speed, "f1": f[0], "f2": f[1], "f3": f[2]}


def bending_frequencies() -> Values:
    """B04: cantilever, bending (Euler-Bernoulli) and torsion."""
    section = RodSection(diameter=4.0e-3)
    bent = Rod(line(0.06, 60), section)
    bent.clamp("start")
    bent.fix(range(61), "z")
    twisted = Rod(line(0.06, 60), section, twist=True)
    twisted.clamp("start")
    twisted.fix(range(61))
    f = frequencies(bent, 3)
    return {"f1": f[0], "f2": f[1], "f3": f[2], "f1_torsion": frequencies(twisted, 1)[0]}


def stretched_string() -> Values:
    """B05: transverse vibrations of a stretched Neo-Hookean cable."""
    section = RodSection(diameter=2.0e-3, law="neo_hookean")
    length, elements = 0.2, 80
    stretch = section.uniaxial.stretch_at(0.5 / section.area)
    own = np.full(elements, length / elements)
    rod = Rod(line(length * stretch, elements), section, reference=own)
    rod.fix([0, elements])
    rod.fix(range(elements + 1), "xz")
    f = frequencies(rod, 3)
    return {"stretch": stretch, "span": length * stretch, "f1": f[0], "f2": f[1], "f3": f[2]}


def elastica() -> Values:
    """B07: cantilever with a dead transverse tip load alpha EI / L^2."""
    section = RodSection(diameter=4.0e-3)
    length = 0.1
    values: Values = {}
    for alpha in (0.5, 2.0, 5.0):
        rod = Rod(line(length, 50), section)
        rod.clamp("start")
        load = alpha * section.bending / length**2
        rod.apply(50, (0.0, load, 0.0))
        equilibrium(rod, increments=4)
        tip = rod.nodes[-1]
        values[f"load_{alpha:g}"] = load
        values[f"transverse_{alpha:g}"] = tip[1] / length
        values[f"shortening_{alpha:g}"] = 1.0 - tip[0] / length
        values[f"slope_{alpha:g}"] = _end_slope(rod)
    return values


def roll_up() -> Values:
    """B08: end moments that bend a rod to half a circle and to a full one."""
    section = RodSection(diameter=2.0e-3)
    length = 0.12
    values: Values = {}
    for name, turns in (("half", 0.5), ("full", 1.0)):
        rod = Rod(line(length, 40), section)
        rod.clamp("start")
        moment = 2.0 * math.pi * turns * section.bending / length
        rod.apply_moment("end", (0.0, 0.0, moment))
        equilibrium(rod, increments=16)
        tip = rod.nodes[-1]
        values[f"moment_{name}"] = moment
        if name == "half":
            values["tip_x_half"], values["tip_y_half"] = tip[0], tip[1]
        else:
            values["tip_distance_full"] = float(np.linalg.norm(tip))
    return values


def quarter_arc() -> Values:
    """B10: a quarter circle loaded out of its plane bends and twists."""
    section = RodSection(diameter=4.0e-3)
    radius, elements = 0.06, 40
    phi = np.linspace(0.0, 0.5 * math.pi, elements + 1)
    nodes = np.stack([radius * np.sin(phi), radius * (1.0 - np.cos(phi)), 0.0 * phi], axis=1)
    values: Values = {}
    for name, load in (("small", 1.0e-5), ("tip_0.005", 0.005), ("tip_0.02", 0.02)):
        rod = Rod(nodes, section, twist=True, curved=True)
        rod.clamp("start", (1.0, 0.0, 0.0))
        rod.apply(elements, (0.0, 0.0, load))
        equilibrium(rod, increments=4)
        tip = rod.nodes[-1]
        if name == "small":
            values["compliance"] = tip[2] / load
        else:
            values[name] = tip.tolist()
    return values


def heavy_cantilever() -> Values:
    """B11: a horizontal cantilever under its own weight."""
    values: Values = {}
    for length in (0.06, 0.1):
        rod = Rod(line(length, 50), RodSection(diameter=4.0e-3))
        rod.clamp("start")
        rod.gravity[:] = (0.0, 0.0, -GRAVITY)
        equilibrium(rod)
        tip = rod.nodes[-1]
        values[f"tip_drop_{length / MILLIMETRE:g}mm"] = -tip[2]
        values[f"tip_x_{length / MILLIMETRE:g}mm"] = tip[0]
    return values


def buckling() -> Values:
    """B13: loads at which the straight rod loses its stiffness."""

    def clamped_free(rod: Rod) -> None:
        rod.clamp("start")

    def pinned(rod: Rod) -> None:
        rod.fix(0)
        rod.fix(40, "y")

    def clamped(rod: Rod) -> None:
        rod.clamp("start")
        rod.clamp("end")
        rod.release(40, "x")

    return {
        "clamped_free": _critical_load(clamped_free, 0.0126),
        "pinned": _critical_load(pinned, 0.0504),
        "clamped_clamped": _critical_load(clamped, 0.2015),
    }


def catenary() -> Values:
    """B16: a cable without bending stiffness between two supports."""
    section = RodSection(diameter=4.0e-3, bending_factor=1.0e-3)
    length, span, elements = 0.6, 0.4, 60
    u = np.linspace(0.0, 1.0, 2001)
    guess = np.stack([span * u, 0.0 * u, -2.0 * span * u * (1.0 - u)], axis=1)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(guess, axis=0), axis=1))])
    even = np.linspace(0.0, way[-1], elements + 1)
    nodes = np.stack([np.interp(even, way, guess[:, c]) for c in range(3)], axis=1)
    rod = Rod(nodes, section, reference=np.full(elements, length / elements))
    rod.fix([0, elements])
    rod.gravity[:] = (0.0, 0.0, -GRAVITY)
    rod.settle(1.0e-5)
    pull = rod.internal_forces()[0]
    vertical = abs(pull[2]) + rod.mass[0] * GRAVITY
    return {
        "horizontal": abs(pull[0]),
        "support": math.hypot(pull[0], vertical),
        "sag": -float(rod.nodes[:, 2].min()),
    }


def density_invariance() -> Values:
    """B22: statics by relaxation do not depend on the density."""
    tips, stretches, moving = [], [], []
    for factor in (1.0, 25.0, 100.0):
        section = RodSection(diameter=4.0e-3, density=1337.0 * factor)
        rod = Rod(line(0.1, 25), section)
        rod.clamp("start")
        rod.apply(25, (0.0, 2.0 * section.bending / 0.1**2, 0.0))
        rod.settle(1.0e-6)
        tips.append(rod.nodes[-1, 1])
        moving.append(rod.energy.kinetic_over_internal)
        bar = Rod(line(0.1, 25), section)
        bar.fix(0)
        bar.apply(25, (0.3122e6 * section.area, 0.0, 0.0))
        bar.settle(1.0e-6)
        stretches.append(bar.nodes[-1, 0])
        moving.append(bar.energy.kinetic_over_internal)
    changes = [np.ptp(tips) / tips[0], np.ptp(stretches) / stretches[0]]
    return {"change": float(max(changes)), "kinetic_over_internal": max(moving)}


def rigid_rotation() -> Values:
    """H01 (rod): a rotated rod carries no force and no energy."""
    section = RodSection(diameter=4.0e-3)
    rod = Rod(line(0.1, 20), section)
    start = rod.nodes
    force, energy = 0.0, 0.0
    for turn in rotations():
        rod.set_nodes(start @ turn.T)
        force = max(force, float(np.abs(rod.internal_forces()).max()))
        energy = max(energy, rod.internal_energy())
    stiffness = section.young * section.area
    return {"force": force / stiffness, "energy": energy / (stiffness * 0.1)}


def _end_slope(rod: Rod) -> float:
    edges = np.diff(rod.nodes, axis=0)[-2:]
    before, after = (math.atan2(edge[1], edge[0]) for edge in edges)
    # An element's direction is the tangent at its middle; half an element is left to the tip.
    return after + 0.5 * (after - before)


def _critical_load(hold: Callable[[Rod], None], start: float) -> float:
    section = RodSection(diameter=4.0e-3)

    def stiffness_under(load: float) -> float:
        rod = Rod(line(0.08, 40), section)
        rod.fix(range(41), "z")
        hold(rod)
        rod.apply(40, (-load, 0.0, 0.0))
        equilibrium(rod, increments=1)
        return lowest_stiffness(rod)

    found = root_scalar(stiffness_under, x0=0.9 * start, x1=start, xtol=1.0e-6 * start, maxiter=4)
    return float(found.root)


def free_flight() -> Values:
    """B19: momentum and energy of a free rod that flies, spins and vibrates."""
    length = 0.2
    rod = Rod(line(length, 40) - [0.5 * length, 0.0, 0.0], RodSection(diameter=4.0e-3))
    place = rod.nodes
    velocity = np.array([0.03, -0.02, 0.01]) + np.cross([3.0, 0.0, 5.0], place)
    velocity[:, 1] += 0.1 * np.sin(math.pi * (place[:, 0] / length + 0.5))
    rod.set_velocities(velocity)

    def momenta() -> tuple[np.ndarray, np.ndarray]:
        speed = rod.velocities
        turning = rod.mass[:, None] * np.cross(rod.nodes, speed)
        return (rod.mass[:, None] * speed).sum(axis=0), turning.sum(axis=0)

    linear, angular = momenta()
    rod.advance(1.0e-4)
    first = rod.energy
    rod.advance(1.0)
    last = rod.energy
    linear_after, angular_after = momenta()
    before = first.kinetic + first.internal
    return {
        "linear": float(np.linalg.norm(linear_after - linear) / np.linalg.norm(linear)),
        "angular": float(np.linalg.norm(angular_after - angular) / np.linalg.norm(angular)),
        "energy": abs(last.kinetic + last.internal - before) / before,
    }


def pendulum() -> Values:
    """B20: a stiff rod swings."""
    return {"small": _period(math.radians(2.0)), "large": _period(math.radians(60.0))}


def weight_on_cable() -> Values:
    """B17: a weight on a Neo-Hookean cable, released from the unstretched state."""
    length, elements, weight = 0.3, 30, 0.2
    rod = Rod(line(-length, elements, 2), RodSection(diameter=2.0e-3, law="neo_hookean"))
    rod.fix(0)
    rod.fix(range(elements + 1), "xy")
    rod.mass[elements] += weight
    rod.gravity[:] = (0.0, 0.0, -GRAVITY)
    lowest = 0.0
    for _ in range(700):
        rod.advance(1.0e-3)
        lowest = min(lowest, rod.nodes[-1, 2])
    # The reference is for a cable without weight of its own.
    rod.mass[:elements] *= 1.0e-3
    rod.settle(1.0e-7)
    stretch = -rod.nodes[-1, 2] / length
    law = rod.section.uniaxial
    tangent = law.tangent(stretch) * rod.section.area / length
    rod.mass[:elements] *= 1.0e3
    return {
        "stretch": stretch,
        "peak": -lowest / length,
        "tangent": tangent,
        "f_massless": math.sqrt(tangent / weight) / (2.0 * math.pi),
        "f_with_cable": frequencies(rod, 1)[0],
    }


def step_load() -> Values:
    """D10 (rod): a large strain wave after a step load."""
    rod = Rod(line(0.1, 50), RodSection(diameter=4.0e-3, law="neo_hookean"))
    rod.fix(0)
    rod.fix(range(51), "yz")
    rod.apply(50, (1.96161045, 0.0, 0.0))
    rod.ramp_loads([0.0, 5.0e-4], [0.0, 1.0])
    times = 1.0e-5 * np.arange(1, 1201)
    track = []
    for _ in times:
        rod.advance(1.0e-5)
        track.append(rod.nodes[-1, 0] - 0.1)
    return wave_record(times, track)


def _period(angle: float) -> float:
    length, elements = 0.25, 20
    down = np.array([math.sin(angle), 0.0, -math.cos(angle)])
    nodes = np.linspace(0.0, length, elements + 1)[:, None] * down
    rod = Rod(nodes, RodSection(diameter=4.0e-3, young=2.6e9))
    rod.fix(0)
    rod.gravity[:] = (0.0, 0.0, -GRAVITY)
    crossings: list[float] = []
    before = rod.nodes[-1, 0]
    while len(crossings) < 3:
        rod.advance(1.0e-3)
        now = rod.nodes[-1, 0]
        if before * now < 0.0:
            crossings.append(rod.time - 1.0e-3 * abs(now) / abs(now - before))
        before = now
    return crossings[2] - crossings[0]
