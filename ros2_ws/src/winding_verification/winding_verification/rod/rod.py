"""General rod model: an open chain of extensible, bending (and twisting) elements."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cable_fem_node.dynamics.model import ExplicitModel
from cable_fem_node.dynamics.state import DivergenceError, FloatArray
from cable_fem_node.rod.rod_kernels import empty_work, stored_energy, turning_angle_squared
from cable_fem_node.rod.rod_records import axial_response
from winding_core.cable.cases import Material
from winding_core.cable.material_law import TABLE_HIGH, TABLE_LOW, MaterialLaw
from winding_verification.rod.rod_kernels import (
    RodEnds,
    RodMesh,
    RodScratch,
    advance_rod,
    rod_forces,
)


@dataclass(frozen=True, kw_only=True)
class RodSection:
    """Round section and material of a rod."""

    diameter: float  # Undeformed [m]
    law: str = "linear"  # Axial law; bending and torsion are linear in E and G
    young: float = Material.young  # E [Pa]
    poisson: float = Material.poisson  # nu
    density: float = Material.density  # [kg/m^3]
    bending_factor: float = 1.0  # Factor on EI, e.g. 1e-3 for a cable that shall only pull

    def __post_init__(self) -> None:
        for name in ("diameter", "young", "density"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be positive, got {getattr(self, name)}")

    @property
    def uniaxial(self) -> MaterialLaw:
        """The axial law."""
        return MaterialLaw(law=self.law, young=self.young, poisson=self.poisson)

    @property
    def area(self) -> float:
        """[m^2]."""
        return 0.25 * math.pi * self.diameter**2

    @property
    def bending(self) -> float:
        """EI [N m^2], with the factor."""
        return self.bending_factor * self.young * math.pi * self.diameter**4 / 64.0

    @property
    def torsion(self) -> float:
        """GJ [N m^2]."""
        return self.uniaxial.shear_modulus * math.pi * self.diameter**4 / 32.0


class Rod(ExplicitModel):
    """A rod through nodes in order.

    Args:
        nodes: (n, 3) [m], in order along the rod.
        section: Section and material.
        reference: Unstressed lengths of the elements (n - 1,) [m]; None takes the nodes' spacing.
        twist: Give every element a twist angle and material frames. Needed for torsion, for
            rods that are curved when unstressed, and for bending coupled with torsion.
        curved: With `twist`: the nodes' shape is the unstressed one; else a straight rod is.
    """

    def __init__(
        self,
        nodes: ArrayLike,
        section: RodSection,
        *,
        reference: ArrayLike | None = None,
        twist: bool = False,
        curved: bool = False,
    ) -> None:
        place = np.asarray(nodes, dtype=float)
        if place.ndim != 2 or place.shape[0] < 3:
            raise ValueError(f"a rod needs at least three nodes, got shape {place.shape}")
        edges = np.diff(place, axis=0)
        lengths = np.linalg.norm(edges, axis=1)
        own = lengths if reference is None else np.asarray(reference, dtype=float)
        if own.shape != lengths.shape or not np.all(own > 0.0):
            raise ValueError(f"reference lengths must be positive, {lengths.size} of them")
        if not np.all(lengths > 0.0):
            raise ValueError(f"element {int(np.argmin(lengths))} has no length")
        if curved and not twist:
            raise ValueError("a curved rod needs twist=True")
        self.section = section
        share = np.zeros(place.shape[0])
        share[:-1] += 0.5 * own
        share[1:] += 0.5 * own
        super().__init__(place, section.density * section.area * share)
        count = own.size
        law = section.uniaxial
        self._law = law
        spin = 0.125 * section.density * section.area * section.diameter**2 * own
        self._mesh = RodMesh(
            reference=own.copy(),
            voronoi=share,
            natural=np.zeros((3, count + 1)),
            response=axial_response(law, section.area),
            bending=section.bending,
            torsion=section.torsion,
            spin_inertia=np.concatenate([spin[:1], spin, spin[-1:]]),
            framed=twist,
        )
        tangents = (edges / lengths[:, None]).T
        walled = np.concatenate([tangents[:, :1], tangents, tangents[:, -1:]], axis=1)
        self._ends = RodEnds(
            clamped=np.zeros(2),
            first=tangents[:, 0].copy(),
            last=tangents[:, -1].copy(),
            moment=np.zeros((3, 2)),
            spin_free=np.concatenate([[0.0], np.ones(count), [0.0]]),
        )
        self._scratch = frames_along(walled)
        # Of bending, with `twist` [s]: moments grow by EI times it times the rate of curvature
        # (Kelvin and Voigt).
        self.viscosity = 0.0
        self._curved = curved
        if curved:
            self._take_shape()

    def set_nodes(self, nodes: ArrayLike) -> None:
        """Place the nodes, shape (n, 3) [m]; to viscosity that is no motion."""
        super().set_nodes(nodes)
        self._forces()

    def clamp(self, end: str, direction: ArrayLike | None = None) -> None:
        """Clamp the "start" or "end": node fixed, direction (3,) held (the present one by default).

        With `twist` the clamp also holds the rod's rotation about its axis.
        """
        side, node = _side(end, self.mass.size)
        self.fix(node)
        self._ends.clamped[side] = 1.0
        own = self._ends.first if side == 0 else self._ends.last
        if direction is not None:
            self.aim(end, direction)
        column = 0 if side == 0 else -1
        self._scratch.carried[:, column] = own
        self._scratch.director[:, column] = perpendicular(
            own, self._scratch.director[:, 1 if side == 0 else -2]
        )
        if self._curved:
            self._take_shape()

    def turn(self, end: str, angle: float) -> None:
        """Turn the clamp of the "start" or "end" of a rod with `twist` about its direction.

        Raises:
            ValueError: The end is not clamped, or the rod has no twist.
        """
        side, _ = _side(end, self.mass.size)
        if not (self.framed and self._ends.clamped[side]):
            raise ValueError(f"only a clamped end of a rod with twist=True can be turned: {end}")
        self._scratch.angle[0 if side == 0 else -1] = angle

    def aim(self, end: str, direction: ArrayLike) -> None:
        """Give the clamp of the "start" or "end" another direction (3,), without spin about it.

        Raises:
            ValueError: The end is not clamped, or the direction is zero.
        """
        side, _ = _side(end, self.mass.size)
        given = np.asarray(direction, dtype=float)
        if not (self._ends.clamped[side] and given.any()):
            raise ValueError(f"a clamped end is aimed, and somewhere; got {end}, {given}")
        own = self._ends.first if side == 0 else self._ends.last
        own[:] = given / np.linalg.norm(given)

    def apply_moment(self, end: str, moment: ArrayLike) -> None:
        """Load an end with a moment vector (3,) [N m] at amplitude one."""
        side, _ = _side(end, self.mass.size)
        self._ends.moment[:, side] = moment

    def lengths(self) -> FloatArray:
        """Return the present lengths of the elements (n - 1,) [m]."""
        return np.asarray(np.linalg.norm(np.diff(self.points.position, axis=1), axis=0))

    def stretch(self) -> FloatArray:
        """Return the stretch of the elements (n - 1,)."""
        return np.asarray(self.lengths() / self._mesh.reference)

    def tension(self) -> FloatArray:
        """Return the tension of the elements (n - 1,) [N]."""
        return self.section.area * self._law.nominal_stress(self.stretch())

    def internal_forces(self, nodes: ArrayLike | None = None) -> FloatArray:
        """Return the elements' forces on the nodes, shape (n, 3) [N], end moments included."""
        self._forces(nodes)
        return self._scratch.work.net.T.copy()

    def _forces(self, nodes: ArrayLike | None = None) -> float:
        """Fill the scratch with forces; return the energy of the frames [J]."""
        place = self.points.position
        if nodes is not None:
            place = np.ascontiguousarray(np.asarray(nodes, dtype=float).T)
        factor = float(np.interp(self.time, *self._load_curve))
        return float(
            rod_forces(self.mass.size, place, self._mesh, self._ends, self._scratch, factor, 0.0)[0]
        )

    def curvatures(self) -> FloatArray:
        """Return present integrated curvatures along both directors and twist (3, n) [rad].

        They are zero at ends that are not clamped, and without `twist`.
        """
        self._forces()
        return self._scratch.curvature.copy()

    def directors(self) -> tuple[FloatArray, FloatArray]:
        """Return the material directors of the nodes, two arrays (3, n).

        Curvatures at a node are the binormal's part along the second one and minus its part along
        the first one; between two elements they are the mean of theirs.
        """
        scratch = self._scratch
        self._forces()
        across = np.cross(scratch.walled, scratch.director, axis=0)
        cosine, sine = np.cos(scratch.angle), np.sin(scratch.angle)
        first = cosine * scratch.director + sine * across
        second = cosine * across - sine * scratch.director
        return 0.5 * (first[:, 1:] + first[:, :-1]), 0.5 * (second[:, 1:] + second[:, :-1])

    @property
    def natural(self) -> FloatArray:
        """Integrated `curvatures` and twist (3, n) [rad] of the unstressed rod (a view)."""
        return self._mesh.natural

    @property
    def reference(self) -> FloatArray:
        """Unstressed lengths of the elements (n - 1,) [m] (a view)."""
        return self._mesh.reference

    @property
    def voronoi(self) -> FloatArray:
        """Unstressed length that each node stands for (n,) [m] (a view)."""
        return self._mesh.voronoi

    @property
    def spin_angles(self) -> FloatArray:
        """Twist angle of every element (n - 1,) [rad] (a view)."""
        return self._scratch.angle[1:-1]

    @property
    def spin_inertia(self) -> FloatArray:
        """Inertia of every element's twist angle (n - 1,) [kg m^2]."""
        return self._mesh.spin_inertia[1:-1]

    @property
    def framed(self) -> bool:
        """Whether the rod has twist angles."""
        return self._mesh.framed

    def force_scale(self) -> float:
        """Return the greatest force that an element passes on, or that loads the rod [N]."""
        outside = super().force_scale()
        return max(outside, float(np.abs(self._scratch.work.force).max()))

    def internal_energy(self) -> float:
        """Return stretching, bending and twisting energy [J]."""
        framed = self._forces()
        mesh, ends = self._mesh, self._ends
        count = mesh.reference.size
        place = self.points.position
        stretching = stored_energy(count, place, mesh.reference, mesh.response)
        if mesh.framed:
            return float(stretching + framed)
        cosine = self._scratch.work.cosine
        inner = range(1 - int(ends.clamped[0]), count + int(ends.clamped[1]))
        bent = sum(
            0.5 * mesh.bending * turning_angle_squared(1.0 - cosine[i]) / mesh.voronoi[i]
            for i in inner
        )
        return float(stretching + bent)

    def critical_step(self) -> float:
        """Return a safe stable step [s] from axial, bending, torsion and contact stiffness.

        Raises:
            ValueError: The viscosity is negative, or the rod has no twist to be viscous with.
        """
        mesh = self._mesh
        if not self.viscosity >= 0.0 or (self.viscosity > 0.0 and not mesh.framed):
            raise ValueError(f"viscosity must not be negative and needs twist: {self.viscosity} s")
        shortest = float(mesh.reference.min())
        stretch = self.stretch()
        extremes = np.clip((stretch.min(), stretch.max()), TABLE_LOW + 1e-3, TABLE_HIGH - 1e-3)
        tangent = max(self._law.tangent(1.0), *map(self._law.tangent, extremes.tolist()))
        lightest = float(self.mass[1:-1].min())
        touch = self._contact_law() if self._contact is not None else None
        tension = max(float(np.abs(self.tension()).max()), 0.0)
        along = 4.0 * tangent * mesh.response.area / shortest
        across = 16.0 * mesh.bending / shortest**3 + 4.0 * tension / shortest
        if self._ends.clamped.any():
            across *= 1.25
        ends = max(0.5 * along, 0.25 * across)
        if touch is not None:
            along += touch.stick_stiffness
            across += touch.normal_stiffness
            ends += touch.normal_stiffness
        step = 2.0 * math.sqrt(lightest / max(along, across))
        if mesh.framed and self.viscosity > 0.0:
            viscous = self.viscosity * 20.0 * mesh.bending / shortest**3
            step = min(step, _damped_step(across, viscous, lightest))
        step = min(step, 2.0 * math.sqrt(float(self.mass.min()) / max(ends, 1.0e-30)))
        if touch is not None:
            step *= _lateness(touch.normal_stiffness, touch.normal_damping, float(self.mass.min()))
        if mesh.framed:
            twisting = 8.0 * mesh.torsion / shortest
            bent = float((self._scratch.curvature[:2] ** 2).sum(axis=0).max())
            viscous = self.viscosity * bent * mesh.bending / shortest
            step = min(step, _damped_step(twisting, viscous, float(self.spin_inertia.min())))
        return step

    def contact_stiffness(self) -> float:
        """Return the normal penalty: six times the stiffness of the shortest element [N/m]."""
        return 6.0 * self.section.young * self.section.area / float(self._mesh.reference.min())

    def _take_shape(self) -> None:
        self._mesh.natural[:] = 0.0
        self.internal_forces()
        self._mesh.natural[:] = self._scratch.curvature

    def _march(self, steps: int, dt: float, calming: bool) -> None:
        at, self._kinetic = advance_rod(
            self.mass.size,
            steps,
            dt,
            self.time,
            self.points,
            self._mesh,
            self._ends,
            self._scratch,
            self._boundary_conditions(calming),
            self._contact_law(),
            self.viscosity,
            self._ledger,
        )
        if at >= 0:
            raise DivergenceError(
                f"the rod diverged before t = {self.time + steps * dt:.6g} s at element {at} of "
                f"{self.mass.size - 1}: its stretch left {TABLE_LOW:g} to {TABLE_HIGH:g} "
                f"(step {dt:.3g} s)"
            )


def _damped_step(stiffness: float, viscous: float, mass: float) -> float:
    """Return the critical step [s] of an oscillator whose dashpot acts half a step late."""
    return 2.0 * math.sqrt(mass / stiffness) * _lateness(stiffness, viscous, mass)


def _lateness(stiffness: float, viscous: float, mass: float) -> float:
    """Return the factor on the critical step for a dashpot that acts half a step late."""
    ratio = 0.5 * viscous / math.sqrt(stiffness * mass)
    return math.sqrt(1.0 + ratio**2) - ratio


def _side(end: str, nodes: int) -> tuple[int, int]:
    if end not in ("start", "end"):
        raise ValueError(f"end must be 'start' or 'end', got {end!r}")
    return (0, 0) if end == "start" else (1, nodes - 1)


def perpendicular(tangent: FloatArray, hint: FloatArray) -> FloatArray:
    """Return the unit vector across a unit tangent that lies closest to a hint, all (3,)."""
    part = hint - (hint @ tangent) * tangent
    return np.asarray(part / np.linalg.norm(part))


def frames_along(walled: FloatArray) -> RodScratch:
    """Return frames without a twist of their own, and scratch, for tangents (3, elements + 2)."""
    count = walled.shape[1] - 2
    director = np.zeros((3, count + 2))
    axis = np.eye(3)[int(np.argmin(np.abs(walled[:, 0])))]
    director[:, 0] = perpendicular(walled[:, 0], axis)
    for i in range(1, count + 2):
        a, b, v = walled[:, i - 1], walled[:, i], director[:, i - 1]
        turn = np.cross(a, b)
        moved = v * (a @ b) + np.cross(turn, v) + turn * (turn @ v) / (1.0 + a @ b)
        director[:, i] = perpendicular(b, moved)
    return RodScratch(
        director=director,
        carried=walled.copy(),
        angle=np.zeros(count + 2),
        spin=np.zeros(count + 2),
        own_twist=np.zeros(count + 1),
        curvature=np.zeros((3, count + 1)),
        work=empty_work(count + 1),
        walled=walled.copy(),
        walled_inverse=np.zeros(count + 2),
        walled_force=np.zeros((3, count + 2)),
        torque=np.zeros(count + 2),
    )
