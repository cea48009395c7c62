"""Rods in motion: conservation, pendulum, falling weight, strain wave."""

from __future__ import annotations

import math

import numpy as np

from winding_verification.rod.rod import Rod
from winding_verification.rod.rod_section import RodSection
from winding_verification.rod.statics import frequencies
from winding_verification.solver.references import Values, wave_record
from winding_verification.solver.rod_statics import GRAVITY, line


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
