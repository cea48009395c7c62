"""An explicit model of nodes: constraints, loads, gravity, damping, contact, ledger, restart.

Rods and solids share it; what differs is where the internal forces come from.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cable_fem_node.dynamics.energy import EnergyLedger
from cable_fem_node.dynamics.failure import DivergenceError, EnergyBalanceError
from cable_fem_node.dynamics.points import (
    LEDGER_SIZE,
    LOSS_CONTACT,
    LOSS_DAMPING,
    LOSS_FRICTION,
    WORK_SPAN,
    WORK_SURFACE,
    WORK_TIE,
    Points,
    empty_points,
)
from cable_fem_node.dynamics.surroundings import Surroundings, Touch

FloatArray = NDArray[np.float64]

AXES = "xyz"


@dataclass(frozen=True, kw_only=True)
class CylinderContact:
    """A rigid cylinder about the z axis that nodes cannot enter.

    Attributes:
        reach: Distance of a touching node from the axis [m]: R + r for a rod's centreline, R for
            the nodes of a solid's surface.
        friction: Coulomb friction; acts where the node is.
        angular_speed: Of the cylinder about +z [rad/s].
        stiffness: Normal penalty per node [N/m]; None takes the model's own.
        damping: Normal dashpot as a share of the critical one.
    """

    reach: float
    friction: float = 0.1
    angular_speed: float = 0.0
    stiffness: float | None = None
    damping: float = 0.2

    def __post_init__(self) -> None:
        if not self.reach > 0.0:
            raise ValueError(f"reach must be positive, got {self.reach} m")
        if not self.friction >= 0.0:
            raise ValueError(f"friction must not be negative, got {self.friction}")


class ExplicitModel(ABC):
    """Nodes that move by central differences under internal and external forces.

    Attributes:
        time: [s]
        mass: Nodal masses (n,) [kg]; may be changed (point masses) before advancing.
        gravity: (3,) [m/s^2].
        load: Nodal loads (3, n) [N] at amplitude one.
        damping_rate: Mass-proportional damping [1/s], towards rest.
    """

    def __init__(self, nodes: ArrayLike, mass: FloatArray) -> None:
        place = np.asarray(nodes, dtype=float)
        if place.ndim != 2 or place.shape[1] != 3 or not np.isfinite(place).all():
            raise ValueError(f"nodes must be finite with shape (n, 3), got shape {place.shape}")
        count = place.shape[0]
        self.points: Points = empty_points(count)
        self.points.position[:] = place.T
        self.time = 0.0
        self.steps = 0
        self.mass = mass
        self.gravity = np.zeros(3)
        self.load = np.zeros((3, count))
        self.damping_rate = 0.0
        self._free = np.ones((3, count))
        self._driven = np.zeros((3, count))
        self._load_curve = (np.zeros(1), np.ones(1))
        self._drive_curve = (np.zeros(1), np.ones(1))
        self._contact: CylinderContact | None = None
        self._ledger = np.zeros(LEDGER_SIZE)
        self._turned = 0.0
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
        self,
        nodes: int | Sequence[int] | NDArray[np.intp],
        velocity: ArrayLike,
        axes: str = AXES,
    ) -> None:
        """Move nodes with a given velocity (3,) [m/s] times the drive's amplitude."""
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

    def ramp_drives(self, times: ArrayLike, values: ArrayLike) -> None:
        """Give the amplitude of all driven velocities over time: a piecewise linear curve."""
        self._drive_curve = _curve(times, values)

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
        radius = np.hypot(self.points.position[0], self.points.position[1])
        depth = np.where(self.touching, self.points.contact_radius - radius, 0.0)
        return np.asarray(self._touch_constants().normal_stiffness * np.maximum(depth, 0.0))

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
        contact = 0.0
        if self._contact is not None:
            touch = self._touch_constants()
            force = self.contact_forces()
            slip = self.points.slip[:, self.touching]
            contact = 0.5 * float((force**2).sum()) / touch.normal_stiffness
            contact += 0.5 * touch.stick_stiffness * float((slip**2).sum())
        ledger = self._ledger
        return EnergyLedger(
            kinetic=self._kinetic,
            internal=self.internal_energy(),
            contact=contact,
            external=float(ledger[WORK_TIE] + ledger[WORK_SURFACE] + ledger[WORK_SPAN]),
            friction=float(ledger[LOSS_FRICTION]),
            damping=float(ledger[LOSS_CONTACT] + ledger[LOSS_DAMPING]),
            initial=self._initial or 0.0,
        )

    def advance(
        self,
        duration: float,
        step: float | None = None,
        *,
        balance_limit_pct: float | None = None,
    ) -> None:
        """Advance by a time [s] in equal steps no longer than `step` (0.8 of the critical one).

        `balance_limit_pct` stops a run whose energy balance is open by more.

        Raises:
            ValueError: The duration is negative or the step exceeds the critical step.
            DivergenceError: The integration failed; says when, at which element and why.
            EnergyBalanceError: The energy balance is open.
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
            self.steps += count
        if balance_limit_pct is not None and self.energy.balance_pct > balance_limit_pct:
            raise EnergyBalanceError(
                f"energy balance open by {self.energy.balance_pct:.3g} % at t = {self.time:.6g} s "
                f"(limit {balance_limit_pct:g} %)"
            )

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
        load, drive = self._load_curve, self._drive_curve
        self._load_curve = (np.zeros(1), np.array([_value(load, held)]))
        self._drive_curve = (np.zeros(1), np.zeros(1))
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
            self._load_curve, self._drive_curve = load, drive
            self.points.velocity[:] = 0.0
            self._kinetic = 0.0
        return left

    def save(self, path: Path) -> None:
        """Write the state; `restore` resumes bit for bit on a model built the same way."""
        arrays = {f"points_{name}": getattr(self.points, name) for name in Points._fields}
        arrays |= {f"own_{name}": value for name, value in self._own_state().items()}
        scalars = np.array(
            [self.time, self.steps, self._turned, self._kinetic, self._initial or 0.0]
        )
        with path.open("wb") as file:
            np.savez(
                file,
                scalars=scalars,
                started=np.array(self._initial is not None),
                ledger=self._ledger,
                **arrays,
            )

    def restore(self, path: Path) -> None:
        """Read a state that `save` wrote.

        Raises:
            ValueError: The state belongs to a model of another size.
        """
        with np.load(path) as stored:
            if stored["points_position"].shape != self.points.position.shape:
                raise ValueError(f"{path} holds {stored['points_position'].shape[1]} nodes, not "
                                 f"{self.mass.size}")  # fmt: skip
            time, steps, self._turned, self._kinetic, initial = map(float, stored["scalars"])
            self.time, self.steps = time, int(steps)
            self._initial = initial if stored["started"] else None
            self._ledger[:] = stored["ledger"]
            for name in Points._fields:
                getattr(self.points, name)[:] = stored[f"points_{name}"]
            for name, value in self._own_state().items():
                value[:] = stored[f"own_{name}"]

    def _own_state(self) -> dict[str, FloatArray]:
        return {}

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
            touch = self._touch_constants()
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

    def _touch_constants(self) -> Touch:
        contact = self._contact
        if contact is None:
            return Touch(1.0, 0.0, 1.0, 0.0, 0.0, 0.0)
        normal = self.contact_stiffness() if contact.stiffness is None else contact.stiffness
        typical = float(np.median(self.mass))
        return Touch(
            normal_stiffness=normal,
            normal_damping=2.0 * contact.damping * math.sqrt(normal * typical),
            stick_stiffness=0.5 * normal,
            stick_damping=0.2 * math.sqrt(0.5 * normal * typical),
            friction=contact.friction,
            cable_radius=0.0,
        )

    def _surroundings(self, calming: bool) -> Surroundings:
        contact = self._contact
        return Surroundings(
            mass=self.mass,
            free=self._free,
            driven=self._driven,
            load=self.load,
            gravity=np.asarray(self.gravity, dtype=float),
            load_times=self._load_curve[0],
            load_values=self._load_curve[1],
            drive_times=self._drive_curve[0],
            drive_values=self._drive_curve[1],
            damping_rate=0.0 if calming else self.damping_rate,
            calming=calming,
            reach=-1.0 if contact is None else contact.reach,
            angular_speed=0.0 if contact is None or calming else contact.angular_speed,
        )


def _curve(times: ArrayLike, values: ArrayLike) -> tuple[FloatArray, FloatArray]:
    t, v = np.atleast_1d(np.asarray(times, float)), np.atleast_1d(np.asarray(values, float))
    if t.shape != v.shape or np.any(np.diff(t) <= 0.0):
        raise ValueError("an amplitude needs as many values as times, and times that increase")
    return t, v


def _value(curve: tuple[FloatArray, FloatArray], t: float) -> float:
    return float(np.interp(t, *curve))
