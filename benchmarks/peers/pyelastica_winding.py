"""The winding in PyElastica: Cosserat rod with stretch, shear, bending and twist.

Two kinds of friction: PyElastica's own, given the velocity of the turning surface (as shipped it
takes a spinning cylinder for a standing one), and a stick spring with memory that PyElastica does
not have, to see what its rod can do. The guide is a stiff spring across the span.
"""

from __future__ import annotations

import math
import time
from importlib.metadata import version
from typing import Any

import elastica
import numpy as np
from numba import njit
from numpy.typing import NDArray
from winding_problem import Outcome, WindingProblem, marks_of_nodes

FloatArray = NDArray[np.float64]

# The largest step found stable: 60 us at 5 mm (80 us diverges), in proportion to the segment.
STEP_PER_SEGMENT = 0.012

# Stiffness of the guide's spring per length of cable behind it [N/m^2].
GUIDE_STIFFNESS = 2.0e5

LOOK_EVERY = 1000


class _System(
    elastica.BaseSystemCollection,
    elastica.Constraints,
    elastica.Forcing,
    elastica.Contact,
    elastica.Damping,
):  # type: ignore[misc]
    pass


class _Clamp(elastica.ConstraintBase):  # type: ignore[misc]
    """P0 and its cross-section turn with the cylinder."""

    def __init__(self, problem: WindingProblem, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._drive = problem.drive
        self._place = np.array([problem.radius, 0.0, 0.0])
        self._directors: FloatArray | None = None

    def constrain_values(self, system: Any, time: float) -> None:
        if self._directors is None:
            self._directors = system.director_collection[..., 0].copy()
        angle = self._drive.positions(float(time))[0]
        c, s = math.cos(angle), math.sin(angle)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        system.position_collection[:, 0] = turn @ self._place
        system.director_collection[..., 0] = self._directors @ turn.T

    def constrain_rates(self, system: Any, time: float) -> None:
        rate = self._drive.speeds(float(time))[0]
        x, y, _ = system.position_collection[:, 0]
        system.velocity_collection[:, 0] = -rate * y, rate * x, 0.0
        system.omega_collection[:, 0] = rate * system.director_collection[:, 2, 0]


class _Still(elastica.ConstraintBase):  # type: ignore[misc]
    """The cylinder stays: it is round, its turning is in the friction."""

    def constrain_values(self, system: Any, time: float) -> None:
        pass

    def constrain_rates(self, system: Any, time: float) -> None:
        system.velocity_collection[...] = 0.0
        system.omega_collection[...] = 0.0


@njit(cache=True)  # type: ignore[untyped-decorator]
def _guide(
    x: FloatArray,
    v: FloatArray,
    force: FloatArray,
    pull: float,
    line: float,
    span: float,
    height: float,
    feed: float,
    segment: float,
    damping: float,
) -> None:
    """Pull the end, and hold what is behind the eye to its line; nodes enter over a segment."""
    nodes = x.shape[1]
    force[1, nodes - 1] -= pull
    for i in range(1, nodes):
        share = segment * min(1.0, max(0.0, (-span - x[1, i]) / segment + 0.5))
        force[0, i] += share * (GUIDE_STIFFNESS * (line - x[0, i]) - damping * v[0, i])
        force[2, i] += share * (GUIDE_STIFFNESS * (height - x[2, i]) - damping * (v[2, i] - feed))


class _GuideAndWeight(elastica.NoForces):  # type: ignore[misc]
    def __init__(self, problem: WindingProblem) -> None:
        super().__init__()
        self._problem = problem
        line_mass = problem.segment_mass / problem.segment_length
        self._damping = math.sqrt(GUIDE_STIFFNESS * line_mass)

    def apply_forces(self, system: Any, time: float = 0.0) -> None:
        problem = self._problem
        _guide(
            system.position_collection,
            system.velocity_collection,
            system.external_forces,
            problem.case.weight,
            problem.radius,
            problem.free_length,
            problem.drive.positions(float(time))[1],
            problem.drive.speeds(float(time))[1],
            problem.segment_length,
            self._damping,
        )


class _OwnFriction(elastica.RodCylinderContact):  # type: ignore[misc]
    """PyElastica's contact and friction, with the rod's velocity relative to the surface."""

    def __init__(self, problem: WindingProblem, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._drive = problem.drive

    def apply_contact(self, system_one: Any, system_two: Any, time: float = 0.0) -> None:
        rate = self._drive.speeds(float(time))[0]
        velocity = system_one.velocity_collection
        lab = velocity.copy()
        velocity[0] += rate * system_one.position_collection[1]
        velocity[1] -= rate * system_one.position_collection[0]
        super().apply_contact(system_one, system_two, time)
        velocity[...] = lab


@njit(cache=True)  # type: ignore[untyped-decorator]
def _stick(
    x: FloatArray,
    v: FloatArray,
    radius: FloatArray,
    force: FloatArray,
    slip: FloatArray,
    dt: float,
    rate: float,
    cylinder: float,
    normal: float,
    drag: float,
    friction: float,
) -> None:
    """Push the elements out of the cylinder; stick springs (2, elements) hold their middles."""
    for i in range(radius.shape[0]):
        px, py = 0.5 * (x[0, i] + x[0, i + 1]), 0.5 * (x[1, i] + x[1, i + 1])
        distance = math.sqrt(px * px + py * py)
        depth = cylinder + radius[i] - distance
        if depth <= 0.0:
            slip[0, i] = slip[1, i] = 0.0
            continue
        nx, ny = px / distance, py / distance
        vx, vy = 0.5 * (v[0, i] + v[0, i + 1]), 0.5 * (v[1, i] + v[1, i + 1])
        along = vy * nx - vx * ny - rate * distance
        across = 0.5 * (v[2, i] + v[2, i + 1])
        press = max(normal * depth - drag * (vx * nx + vy * ny), 0.0)
        slip[0, i] += along * dt
        slip[1, i] += across * dt
        # The stick spring is half as stiff as the normal one, its dashpot 0.3 of the normal one.
        ft, fz = -0.5 * normal * slip[0, i], -0.5 * normal * slip[1, i]
        size = math.sqrt(ft * ft + fz * fz)
        if size > friction * press:
            scale = friction * press / size
            ft, fz = scale * ft, scale * fz
            slip[0, i] *= scale
            slip[1, i] *= scale
        else:
            ft -= 0.3 * drag * along
            fz -= 0.3 * drag * across
        for j in (i, i + 1):
            force[0, j] += 0.5 * (press * nx - ft * ny)
            force[1, j] += 0.5 * (press * ny + ft * nx)
            force[2, j] += 0.5 * fz


class _StickFriction(elastica.NoForces):  # type: ignore[misc]
    def __init__(self, problem: WindingProblem, dt: float, normal: float, drag: float) -> None:
        super().__init__()
        self._problem, self._dt = problem, dt
        self._normal, self._drag = normal, drag
        self._slip: FloatArray | None = None

    def apply_forces(self, system: Any, time: float = 0.0) -> None:
        if self._slip is None:
            self._slip = np.zeros((2, system.n_elems))
        _stick(
            system.position_collection,
            system.velocity_collection,
            system.radius,
            system.external_forces,
            self._slip,
            self._dt,
            self._problem.drive.speeds(float(time))[0],
            self._problem.case.cylinder_radius,
            self._normal,
            self._drag,
            self._problem.friction,
        )


def wind(problem: WindingProblem, *, memory: bool) -> Outcome:
    """Wind with PyElastica's own friction, or with stick springs that have a memory.

    The rod's section shrinks as it stretches and its stress is linear on the shrunk section, so
    it stretches by 1 / (1 - F / EA) and lies closer to the axis.
    """
    case = problem.case
    dt = STEP_PER_SEGMENT * problem.segment_length
    stretch = 1.0 / (1.0 - case.weight / problem.axial_stiffness)
    arc = problem.stations(stretch)
    system = _System()
    rod = elastica.CosseratRod.straight_rod(
        arc.size - 1,
        np.array([problem.radius, 0.0, 0.0]),
        np.array([0.0, -1.0, 0.0]),
        np.array([0.0, 0.0, 1.0]),
        arc[-1],
        case.cable_radius,
        case.material.density,
        youngs_modulus=case.material.young,
        shear_modulus=case.material.young / (2.0 * (1.0 + case.material.poisson)),
    )
    rod.position_collection[1] *= stretch
    cylinder = elastica.Cylinder(
        start=np.array([0.0, 0.0, -0.1]),
        direction=np.array([0.0, 0.0, 1.0]),
        normal=np.array([1.0, 0.0, 0.0]),
        base_length=0.3,
        base_radius=case.cylinder_radius,
        density=1000.0,
    )
    system.append(rod)
    system.append(cylinder)
    # As stiff as the explicit step allows.
    normal = problem.segment_mass * (0.5 / dt) ** 2
    drag = math.sqrt(normal * problem.segment_mass)
    system.constrain(rod).using(_Clamp, problem=problem)
    system.constrain(cylinder).using(_Still)
    system.add_forcing_to(rod).using(_GuideAndWeight, problem=problem)
    if memory:
        system.add_forcing_to(rod).using(
            _StickFriction, problem=problem, dt=dt, normal=normal, drag=drag
        )
    else:
        system.detect_contact_between(rod, cylinder).using(
            _OwnFriction,
            problem=problem,
            k=normal,
            nu=drag,
            # Far above what the explicit step lets it reach: friction is capped by mu N.
            velocity_damping_coefficient=1000.0 * problem.segment_mass / dt,
            friction_coefficient=problem.friction,
        )
    system.dampen(rod).using(
        elastica.AnalyticalLinearDamper,
        uniform_damping_constant=problem.damping_rate,
        time_step=dt,
    )
    system.finalize()
    stepper = elastica.PositionVerlet()
    # A step of no length compiles what is not yet compiled.
    now = stepper.step(system, np.float64(0.0), np.float64(1.0e-12))
    steps = round(problem.duration / dt)
    started = time.process_time()
    for step in range(steps):
        now = stepper.step(system, now, np.float64(dt))
        if step % LOOK_EVERY == 0 and not np.isfinite(rod.position_collection[0, -1]):
            break
    used = time.process_time() - started
    place = rod.position_collection.T.copy()
    return Outcome(
        solver="PyElastica, stick springs added" if memory else "PyElastica, own friction",
        version=version("pyelastica"),
        step=dt,
        elements=arc.size - 1,
        cpu_seconds=used,
        duration=float(now),
        diverged=not np.isfinite(place).all(),
        stretch=stretch,
        wound_radius=case.cylinder_radius + case.cable_radius / math.sqrt(stretch),
        marks=marks_of_nodes(place, arc, problem, float(now)),
    )
