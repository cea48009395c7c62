"""An explicit model of nodes: constraints, loads, gravity, damping, contact, ledger, restart.

Rods and solids share it; what differs is where the internal forces come from.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cable_fem_node.dynamics.contact_springs import contact_energy, normal_forces
from cable_fem_node.dynamics.motion_kernels import BoundaryConditions
from cable_fem_node.dynamics.state import (
    LEDGER_SIZE,
    ContactLaw,
    CylinderContact,
    DivergenceError,
    EnergyLedger,
    FloatArray,
    Points,
    empty_points,
    penalty,
)

AXES = "xyz"


class ExplicitModel(ABC):
    """Nodes that move by central differences under internal and external forces."""

    def __init__(self, nodes: ArrayLike, mass: FloatArray) -> None:
        place = np.asarray(nodes, dtype=float)
        if place.ndim != 2 or place.shape[1] != 3 or not np.isfinite(place).all():
            raise ValueError(f"nodes must be finite with shape (n, 3), got shape {place.shape}")
        count = place.shape[0]
        self.points: Points = empty_points(count)
        self.points.position[:] = place.T
        self.time = 0.0  # [s]
        self.mass = mass  # Nodal masses (n,) [kg]; may be changed (point masses) before advancing
        self.gravity = np.zeros(3)  # (3,) [m/s^2]
        self.load = np.zeros((3, count))  # Nodal loads (3, n) [N] at amplitude one
        self.damping_rate = 0.0  # Mass-proportional damping [1/s], towards rest
        self._free = np.ones((3, count))
        self._driven = np.zeros((3, count))
        self._load_curve = (np.zeros(1), np.ones(1))
        self._contact: CylinderContact | None = None
        self._ledger = np.zeros(LEDGER_SIZE)
        self._kinetic = 0.0
        self._initial: float | None = None

    @property
    def nodes(self) -> FloatArray:
        """Positions of the nodes, shape (n, 3) [m] (a copy)."""
        return np.ascontiguousarray(self.points.position.T)

    @property
    def velocities(self) -> FloatArray:
        """Velocities of the nodes half a step ago, shape (n, 3) [m/s] (a copy)."""
        return np.ascontiguousarray(self.points.velocity.T)

    def set_nodes(self, nodes: ArrayLike) -> None:
        """Place the nodes, shape (n, 3) [m]."""
        self.points.position[:] = np.asarray(nodes, dtype=float).T

    def set_velocities(self, velocities: ArrayLike) -> None:
        """Set the nodes' velocities, shape (n, 3) [m/s]."""
        self.points.velocity[:] = np.asarray(velocities, dtype=float).T

    def fix(self, nodes: int | Sequence[int] | NDArray[np.intp], axes: str = AXES) -> None:
        """Hold nodes where they are, along some axes."""
        self.drive(nodes, (0.0, 0.0, 0.0), axes)

    def release(self, nodes: int | Sequence[int] | NDArray[np.intp], axes: str = AXES) -> None:
        """Let nodes move again, along some axes."""
        for axis in axes:
            self._free[AXES.index(axis), nodes] = 1.0

    def drive(
        self, nodes: int | Sequence[int] | NDArray[np.intp], velocity: ArrayLike, axes: str = AXES
    ) -> None:
        """Move nodes with a given velocity (3,) [m/s]."""
        given = np.asarray(velocity, dtype=float)
        for axis in axes:
            row = AXES.index(axis)
            self._free[row, nodes] = 0.0
            self._driven[row, nodes] = given[row]

    def apply(self, nodes: int | Sequence[int] | NDArray[np.intp], force: ArrayLike) -> None:
        """Add a force (3,) [N] in equal parts to the loads of nodes."""
        chosen = np.atleast_1d(np.asarray(nodes))
        self.load[:, chosen] += np.asarray(force, dtype=float)[:, None] / chosen.size

    def ramp_loads(self, times: ArrayLike, values: ArrayLike) -> None:
        """Give the amplitude of all loads over time: a piecewise linear curve."""
        self._load_curve = _curve(times, values)

    def touch(self, contact: CylinderContact | None) -> None:
        """Put a cylinder into the model, or take it out."""
        self._contact = contact

    @property
    def touching(self) -> NDArray[np.bool_]:
        """Which nodes touch the cylinder, shape (n,)."""
        return np.asarray(self.points.touching == 1)

    def contact_forces(self) -> FloatArray:
        """Return the normal force of the cylinder on each node, shape (n,) [N]."""
        if self._contact is None:
            return np.zeros(self.mass.size)
        return normal_forces(self.points, self._contact_law())

    @abstractmethod
    def internal_forces(self, nodes: ArrayLike | None = None) -> FloatArray:
        """Return the elements' forces on the nodes, shape (n, 3) [N], here or at given nodes."""

    @abstractmethod
    def internal_energy(self) -> float:
        """Return the stored energy of the elements [J]."""

    @abstractmethod
    def critical_step(self) -> float:
        """Return a safe estimate of the greatest stable step [s]."""

    @abstractmethod
    def contact_stiffness(self) -> float:
        """Return the model's own normal penalty per node [N/m]."""

    @abstractmethod
    def _march(self, steps: int, dt: float, calming: bool) -> None:
        """Take equal steps."""

    @property
    def energy(self) -> EnergyLedger:
        """The ledger since the first advance."""
        touching = self._contact is not None
        return EnergyLedger.of(
            self._ledger,
            kinetic=self._kinetic,
            internal=self.internal_energy(),
            contact=contact_energy(self.points, self._contact_law()) if touching else 0.0,
            initial=self._initial or 0.0,
        )

    def advance(self, duration: float, step: float | None = None) -> None:
        """Advance by a time [s] in equal steps no longer than `step` (0.8 of the critical one).

        Raises:
            ValueError: The duration is negative or the step exceeds the critical step.
            DivergenceError: The integration failed; names time, element and cause.
        """
        if not (math.isfinite(duration) and duration >= 0.0):
            raise ValueError(f"duration must not be negative, got {duration} s")
        longest = self.critical_step()
        if step is None:
            step = 0.8 * longest
        elif not 0.0 < step <= longest:
            raise ValueError(f"step must lie in (0, {longest:.4g}] s to be stable, got {step} s")
        if self._initial is None:
            self._initial = self.internal_energy() + self._kinetic_energy()
        count = math.ceil(duration / step - 1.0e-9)
        if count > 0:
            self._march(count, duration / count, False)
            self.time += duration

    def settle(self, tolerance: float = 1.0e-6, batches: int = 400, length: int = 2000) -> float:
        """Come to rest by kinetic damping; loads and drives stand at their present amplitude.

        Args:
            tolerance: Relative: net force on a free node over the greatest force in the model.
            batches: Most batches of steps.
            length: Steps in a batch.

        Returns:
            The share of force that is left unbalanced.

        Raises:
            DivergenceError: The model did not come to rest, or diverged.
        """
        held = self.time
        step = 0.8 * self.critical_step()
        load, driven = self._load_curve, self._driven
        self._load_curve = (np.zeros(1), np.array([_value(load, held)]))
        self._driven = np.zeros_like(driven)
        self.points.velocity[:] = 0.0
        try:
            for _ in range(batches):
                self._march(length, step, True)
                left = self._imbalance()
                if left <= tolerance:
                    break
            else:
                raise DivergenceError(
                    f"the model did not come to rest at t = {held:g} s: {left:.2g} of the force "
                    f"is unbalanced after {batches * length} steps (tolerance {tolerance:g})"
                )
        finally:
            self._load_curve, self._driven = load, driven
            self.points.velocity[:] = 0.0
            self._kinetic = 0.0
        return left

    def _kinetic_energy(self) -> float:
        return 0.5 * float((self.mass * (self._free * self.points.velocity) ** 2).sum())

    def _net_forces(self) -> FloatArray:
        """Return internal, external and contact forces together, shape (3, n)."""
        factor = _value(self._load_curve, self.time)
        net = self.internal_forces().T + factor * self.load + self.gravity[:, None] * self.mass
        if self._contact is not None:
            place = self.points.position
            radius = np.hypot(place[0], place[1])
            normal = self.contact_forces()
            touch = self._contact_law()
            along = -touch.stick_stiffness * self.points.slip[0] * self.touching
            net[0] += (normal * place[0] - along * place[1]) / radius
            net[1] += (normal * place[1] + along * place[0]) / radius
            net[2] -= touch.stick_stiffness * self.points.slip[1] * self.touching
        return np.asarray(net)

    def force_scale(self) -> float:
        """Return the greatest force in the model [N], against which balance is judged."""
        weight = float(np.abs(self.gravity).max() * self.mass.sum())
        return max(
            float(np.abs(self.internal_forces()).max()), float(np.abs(self.load).max()), weight
        )

    def _imbalance(self) -> float:
        net = float(np.abs(self._net_forces() * self._free).max())
        return net / max(self.force_scale(), 1.0e-30)

    def _contact_law(self) -> ContactLaw:
        contact = self._contact
        if contact is None:
            return penalty(1.0, 0.0, friction=0.0, stick_share=1.0)
        typical = float(np.median(self.mass))
        return penalty(
            self.contact_stiffness(), typical, friction=contact.friction, stick_share=0.5
        )

    def _boundary_conditions(self, calming: bool) -> BoundaryConditions:
        contact = self._contact
        return BoundaryConditions(
            mass=self.mass,
            free=self._free,
            driven=self._driven,
            load=self.load,
            gravity=np.asarray(self.gravity, dtype=float),
            load_times=self._load_curve[0],
            load_values=self._load_curve[1],
            damping_rate=0.0 if calming else self.damping_rate,
            calming=calming,
            reach=-1.0 if contact is None else contact.reach,
        )


def _curve(times: ArrayLike, values: ArrayLike) -> tuple[FloatArray, FloatArray]:
    t, v = np.atleast_1d(np.asarray(times, float)), np.atleast_1d(np.asarray(values, float))
    if t.shape != v.shape or np.any(np.diff(t) <= 0.0):
        raise ValueError("an amplitude needs as many values as times, and times that increase")
    return t, v


def _value(curve: tuple[FloatArray, FloatArray], t: float) -> float:
    return float(np.interp(t, *curve))
