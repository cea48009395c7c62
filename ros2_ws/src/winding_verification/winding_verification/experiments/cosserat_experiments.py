"""The experiments of cosseratbench with this rod, judged by that benchmark's own definitions."""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial import legendre
from scipy.linalg import eigh
from scipy.optimize import brentq

from cable_fem_node.dynamics.state import CylinderContact, FloatArray
from cable_fem_node.winding.resolved_model import chord_radius
from winding_verification.experiments.scenario import CLAMPED, FREE, Scenario, ScenarioRod
from winding_verification.rod.rod import Rod
from winding_verification.rod.statics import equilibrium

Metrics = dict[str, float]

# Twist: from when on growth is exponential, and up to which distance [m].
_SETTLED_S, _LINEAR = 2.0, 1.0e-2
_GROWING = 0.05  # [1/s]


def cantilever(scenario: Scenario) -> Metrics:
    """Relative error of the tip's deflection against Euler and Bernoulli."""
    spec = scenario.rods[0]
    rod, _ = _built(spec, 50)
    equilibrium(rod, increments=2)
    load = float(np.linalg.norm(spec.load))
    reference = load * spec.length**3 / (3.0 * spec.section.bending)
    moved = (rod.nodes[-1] - spec.line[-1]) @ spec.load / load
    return {"tip_deflection_error": abs(float(moved) / reference - 1.0)}


def catenary(scenario: Scenario) -> Metrics:
    """Largest distance from the elastic catenary in lengths, relative error of the sag."""
    spec = scenario.rods[0]
    rod, _ = _built(spec, 100)
    rod.gravity[:] = scenario.gravity
    rod.settle(1.0e-5)
    up = -scenario.gravity / np.linalg.norm(scenario.gravity)
    start, chord = spec.line[0], spec.line[-1] - spec.line[0]
    span = float(np.linalg.norm(chord))
    x, z = elastic_catenary(spec, float(np.linalg.norm(scenario.gravity)), span)
    place = rod.nodes - start
    along, height = place @ (chord / span), place @ up
    away = np.hypot(along[:, None] - x, height[:, None] - z).min(axis=1)
    return {
        "shape_error": float(away.max()) / spec.length,
        "sag_error": abs(float(height.min()) / float(z.min()) - 1.0),
    }


def pendulum(scenario: Scenario) -> Metrics:
    """Relative error of the period, relative change of the swing; nothing is damped."""
    spec = scenario.rods[0]
    rod, _ = _built(spec, 100)
    rod.gravity[:] = scenario.gravity
    frames = 200
    times = scenario.duration * np.arange(frames + 1) / frames
    down = scenario.gravity / np.linalg.norm(scenario.gravity)
    off = spec.line[-1] - spec.line[0]
    aside = off - (off @ down) * down
    aside /= np.linalg.norm(aside)
    swing = [float(rod.nodes[-1] @ aside)]
    for t in times[1:]:
        rod.advance(float(t) - rod.time)
        swing.append(float(rod.nodes[-1] @ aside))
    x = np.array(swing)
    expected = hanging_period(spec, float(np.linalg.norm(scenario.gravity)))
    period = _fitted_period(times, x, expected)
    first, last = times <= period, times >= times[-1] - period
    change = (
        _sinusoid(times[last], x[last], period)[0] / _sinusoid(times[first], x[first], period)[0]
    )
    return {"period_error": abs(period / expected - 1.0), "amplitude_change": change - 1.0}


def twist(scenario: Scenario) -> Metrics:
    """Relative error of the twist at which straight rods lose their stability.

    Rods held near that twist stray exponentially at a rate s that obeys
    s^2 + c s = a (twist - critical), whatever the damping c is; the line through the three
    growing rods that are nearest is extrapolated to no growth.
    """
    levels, rates = [], []
    for spec in scenario.rods:
        levels.append(float(spec.turn[-1]) / critical_twist(spec))
        rates.append(_growth(spec, scenario.duration))
    s, level = np.array(rates), np.array(levels)
    growing = np.flatnonzero(np.isfinite(s) & (s > _GROWING))[:3]
    if growing.size < 3:
        return {"critical_twist_error": math.nan}
    s, level = s[growing], level[growing]
    (_, a, b), *_ = np.linalg.lstsq(np.stack([-s, level, np.ones(3)], axis=1), s**2, rcond=None)
    return {"critical_twist_error": abs(-b / a - 1.0)}


def capstan(scenario: Scenario) -> Metrics:
    """How far the light end rises at most [m]."""
    spec, obstacle = scenario.rods[0], scenario.obstacles[0]
    elements = round(spec.length / 2.5e-3)
    nodes, reference = spec.nodes(elements)
    turn = _onto_z(obstacle.axis)
    nodes = nodes @ turn.T
    wrap = obstacle.radius + 0.5 * spec.section.diameter
    reach = chord_radius(wrap, float(np.linalg.norm(np.diff(nodes, axis=0), axis=1).mean()))
    radius = np.hypot(nodes[:, 0], nodes[:, 1])
    # The file's points lie a hair off the cylinder, and nodes between them a hair less.
    near = (np.abs(radius - wrap) < 1.0e-3 * wrap) & (nodes @ (turn @ scenario.gravity) < 0.0)
    nodes[near, :2] *= (reach / radius[near])[:, None]
    rod = Rod(nodes, spec.section, reference=reference)
    rod.gravity[:] = turn @ scenario.gravity
    rod.touch(CylinderContact(reach=reach, friction=obstacle.friction))
    rod.damping_rate = 5.0 if scenario.quasi_static else 0.0
    down = rod.gravity / np.linalg.norm(rod.gravity)
    start = float(rod.nodes[0] @ down)
    highest = 0.0
    while rod.time < scenario.duration - 1.0e-9:
        rod.advance(min(0.01, scenario.duration - rod.time))
        highest = max(highest, start - float(rod.nodes[0] @ down))
        if highest > 0.5 * spec.length:
            break
    return {"slide": highest}


def elastic_catenary(
    spec: ScenarioRod, gravity: float, span: float, points: int = 2001
) -> tuple[FloatArray, FloatArray]:
    """Return (x, z) [m] of a limp elastic cable between two supports of one height."""
    section, length = spec.section, spec.length
    weight = section.density * section.area * gravity
    stiffness = section.young * section.area
    s = np.linspace(0.0, length, points)
    vertical = weight * (s - 0.5 * length)
    end = 0.5 * weight * length

    def x(pull: float) -> FloatArray:
        hang = np.arcsinh(vertical / pull) + math.asinh(end / pull)
        return np.asarray(pull * s / stiffness + pull / weight * hang)

    pull = brentq(lambda h: x(h)[-1] - span, 1.0e-6 * end, 1.0e6 * end, xtol=1.0e-15)
    z = (vertical**2 - end**2) / (2.0 * weight * stiffness)
    z += (np.hypot(pull, vertical) - math.hypot(pull, end)) / weight
    return x(pull), z


def hanging_period(spec: ScenarioRod, gravity: float, terms: int = 40) -> float:
    """Return the period [s] of the slowest small swing of a hanging rod, pinned at the top.

    Galerkin's method with Legendre polynomials of the height over the free end; bending, and
    tension over the stretched length, as the benchmark has it.
    """
    section, length = spec.section, spec.length
    u, weights = legendre.leggauss(2 * terms)
    mass = section.density * section.area
    # u runs from the free end (-1) to the pin (1).
    pull = mass * gravity * 0.5 * length * (1.0 + u)
    effective = pull / (1.0 + pull / (section.young * section.area))
    # Shapes that vanish at the pin, and their first two derivatives.
    combined = np.eye(terms + 1)[:, :terms] - np.eye(terms + 1)[:, 1:]
    shape, slope, bend = (
        legendre.legval(u, legendre.legder(combined, order)) * (2.0 / length) ** order
        for order in range(3)
    )
    scale = 0.5 * length * weights
    stiffness = (bend * scale * section.bending) @ bend.T + (slope * scale * effective) @ slope.T
    inertia = (shape * scale * mass) @ shape.T
    squared = eigh(stiffness, inertia, eigvals_only=True, subset_by_index=(0, 0))[0]
    return 2.0 * math.pi / math.sqrt(squared)


def critical_twist(spec: ScenarioRod) -> float:
    """Return the twist [rad] at which a straight clamped rod under tension buckles (Greenhill).

    A sideways displacement w = x + i y obeys B w'''' - i M w''' - T w'' = 0 with w = w' = 0 at
    both ends; the least moment M with a solution is sought above the long rod's 2 sqrt(B T).
    """
    section, length = spec.section, spec.length
    tension = float(np.linalg.norm(spec.load)) * length**2 / section.bending
    low = 2.0 * math.sqrt(tension)
    moments = low + np.linspace(1.0e-6, 20.0, 4001)
    values = [_greenhill(m, tension) for m in moments]
    first = int(np.flatnonzero(np.sign(values[:-1]) != np.sign(values[1:]))[0])
    moment = brentq(_greenhill, moments[first], moments[first + 1], args=(tension,))
    return float(moment * section.bending / section.torsion)


def _greenhill(moment: float, tension: float) -> float:
    """Return a number that changes its sign where such a rod buckles; both without dimension.

    With w'' = exp(i m z / 2) v, v'' = -k^2 v, k^2 = m^2 / 4 - t, the ends' conditions are that the
    integrals of w'' and of z w'' vanish; the determinant of v's two shapes is real up to
    a phase.
    """
    k = math.sqrt(0.25 * moment**2 - tension)
    h = 0.5 * moment

    def integrals(a: float) -> tuple[complex, complex]:
        # Of exp(i a z) and of z exp(i a z) over -1/2 to 1/2: real, and imaginary.
        if abs(a) < 1.0e-4:
            return complex(1.0 - a * a / 24.0), 1j * a / 12.0
        sine, cosine = math.sin(0.5 * a), math.cos(0.5 * a)
        return complex(2.0 * sine / a), 1j * (2.0 * sine / a**2 - cosine / a)

    (p0, p1), (q0, q1) = integrals(h + k), integrals(h - k)
    return float(((p0 * q1 - q0 * p1) / 1j).real / k)


def _built(spec: ScenarioRod, elements: int, *, framed: bool = False) -> tuple[Rod, FloatArray]:
    nodes, reference = spec.nodes(elements)
    rod = Rod(nodes, spec.section, reference=reference, twist=framed)
    chord = spec.line[-1] - spec.line[0]
    for side, node, held in (("start", 0, spec.start), ("end", elements, spec.end)):
        if held == CLAMPED:
            rod.clamp(side, chord)
        elif held != FREE:
            rod.fix(node)
    rod.apply(elements, spec.load)
    return rod, chord / np.linalg.norm(chord)


def _growth(spec: ScenarioRod, duration: float) -> float:
    """Return the rate at which a rod with held twist strays [1/s]; nan for too few samples."""
    # The discrete rod buckles 1.7 to 2.2 % early with 50 elements, and 1 / n^2 of that with more.
    rod, along = _built(spec, 125, framed=True)
    if spec.slides:
        rod.release(rod.mass.size - 1, "xyz"[int(np.argmax(np.abs(along)))])
    # Two radians a second for a mode of some hertz: neither quick nor slow.
    rod.damping_rate = 5.0
    held = float(spec.turn_times[-1])
    period = 2.0e-3
    times, away = [], []
    for i in range(1, round(duration / period) + 1):
        t = period * i
        if t <= held + period:
            rod.turn("end", float(np.interp(t, spec.turn_times, spec.turn)))
        rod.advance(t - rod.time)
        if i % 25 == 0 and t >= held + _SETTLED_S:
            off = rod.nodes - spec.line[0]
            sideways = off - np.outer(off @ along, along)
            times.append(t)
            away.append(float(np.linalg.norm(sideways, axis=1).max()))
            if away[-1] >= _LINEAR:
                break
    usable = np.array(away) < _LINEAR
    if usable.sum() < 5:
        return math.nan
    return float(np.polyfit(np.array(times)[usable], np.log(np.array(away)[usable]), 1)[0])


def _sinusoid(t: FloatArray, x: FloatArray, period: float) -> tuple[float, float]:
    """Return amplitude and squared residual of the sinusoid of a period that fits best."""
    angle = 2.0 * math.pi * t / period
    basis = np.stack([np.cos(angle), np.sin(angle), np.ones_like(t)], axis=1)
    found = np.linalg.lstsq(basis, x, rcond=None)[0]
    left = x - basis @ found
    return math.hypot(found[0], found[1]), float(left @ left)


def _fitted_period(t: FloatArray, x: FloatArray, about: float) -> float:
    periods = about * np.geomspace(0.5, 2.0, 301)
    for _ in range(8):
        best = int(np.argmin([_sinusoid(t, x, p)[1] for p in periods]))
        low, high = periods[max(best - 1, 0)], periods[min(best + 1, periods.size - 1)]
        periods = np.linspace(low, high, 41)
    return float(periods[int(np.argmin([_sinusoid(t, x, p)[1] for p in periods]))])


def _onto_z(axis: FloatArray) -> FloatArray:
    """Return a rotation (3, 3) that turns a unit vector onto +z."""
    across = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(across, axis)
    x /= np.linalg.norm(x)
    return np.array([x, np.cross(axis, x), axis])
