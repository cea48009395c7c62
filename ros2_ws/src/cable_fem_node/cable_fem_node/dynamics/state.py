"""What every explicit model shares: nodes, contact with the cylinder, energy ledger, failures."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from winding_core.cable.condition import Condition

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Entries of the ledger [J] that kernels add to.
(
    WORK_TIE,
    WORK_SURFACE,
    WORK_SPAN,
    WORK_INFLOW,
    LOSS_FRICTION,
    LOSS_CONTACT,
    LOSS_DAMPING,
    LOSS_RELAXATION,
) = range(8)
LEDGER_SIZE = 8


class Points(NamedTuple):
    """Arrays of the nodes; column i is node i."""

    position: FloatArray  # (3, capacity) [m]
    velocity: FloatArray  # (3, capacity) [m/s], half a step behind the position
    slip: FloatArray  # (2, capacity) stick spring: along the circumference and z [m]
    contact_radius: FloatArray  # (capacity,) radius at which the node touches [m]
    touching: IntArray  # (capacity,) 1 while in contact
    roll: FloatArray  # (2, capacity) roll angle [rad] and rate [rad/s] about the cable's axis
    below: FloatArray  # (BELOW_HEIGHT, capacity) cable that nodes may lie on, see below; (0,
    # capacity) where there is none


# Rows of `Points.below`: of each of the nearest centre lines radius [m], z [m], how both go with
# the wound angle [m/rad], distance at which they touch [m], 0 for none, number of the element that
# it is of, -1 of cable at rest, share of the way along that, its push in the last step [N] if it is
# integrated, and the inverse square of its length with the wound angle [1/m^2].
BELOW_ROWS, MOST_BELOW = 9, 4
# Then the wound angle that the node has gone since the look [rad], and from the last step whether
# it lies on cable, at rest (1) or integrated (2), the sum of their pushes and its parts along
# radius, axis and circumference [N], those of all dashpots on the node [N], and the sums of pushes
# times the rates of what moves below: of its radius and z [N m/s], and of its angle over the
# surface [N rad/s]. Then the force of what lies on the node, along radius, axis and circumference
# [N], and at last the node's own radius [m], the rates of that [m/s] and of its angle over the
# surface [rad/s], and its inverse radius [1/m].
GONE = BELOW_ROWS * MOST_BELOW
PUSHES = GONE + 1
DAMPED = PUSHES + 5
LOADS = PUSHES + 11
RATES = LOADS + 3
INVERSE = RATES + 3
BELOW_HEIGHT = INVERSE + 1


# Share of the cylinder's stiffness that cable and flanges have. Turns that the lag pushes against
# each other overlap by less than 0.01 d.
BESIDE = 0.6


class ContactLaw(NamedTuple):
    """Constants of the contact with the cylinder, per node."""

    normal_stiffness: float  # push for each metre of depth [N/m]
    normal_damping: float  # push for each metre per second [N s/m]
    stick_stiffness: float  # friction for each metre of the stick spring [N/m]
    stick_damping: float  # friction for each metre per second while sticking [N s/m]
    friction: float  # Coulomb's coefficient
    cable_radius: float  # undeformed [m]
    beside_stiffness: float = 0.0  # of cable on cable, and of flanges [N/m]
    beside_damping: float = 0.0  # of the same [N s/m]
    line: float = 0.0  # radius of the centre line of cable on the cylinder [m]
    chords: float = 0.0  # radius of its nodes, which chords join [m]
    apart: float = 0.0  # distance of the centre lines of cable on cable [m]
    low: float = -math.inf  # least z of a centre line between the flanges [m]
    high: float = math.inf  # largest one [m]
    rim: float = 0.0  # radius of the flanges [m]


class Surface(NamedTuple):
    """The cylinder's surface in one step, and how cable lands on it."""

    turned: float  # rotation of the cylinder in the step before [rad]
    turning: float  # rotation in the step that follows [rad]
    landing: float  # radius at which a free node touches [m]
    rolling: bool  # whether the cable may roll about its axis
    edge: int  # outermost node that touches, at which wound cable lands; it and those beyond do
    # not bounce
    gripped: int  # nodes before it are held along the circumference; the edge, or the two outermost
    # nodes, must be free of that where elastic cable is wound, until the next node has landed: a
    # wound element keeps the tension at which both its nodes are held, and what is off the cylinder
    # pulls more than the wound cable


def empty_points(capacity: int) -> Points:
    """Return the arrays of so many nodes, at rest in the origin."""
    return Points(
        position=np.zeros((3, capacity)),
        velocity=np.zeros((3, capacity)),
        slip=np.zeros((2, capacity)),
        contact_radius=np.zeros(capacity),
        touching=np.zeros(capacity, dtype=np.int64),
        roll=np.zeros((2, capacity)),
        below=np.zeros((0, capacity)),
    )


@dataclass(frozen=True, kw_only=True)
class EnergyLedger:
    """Energies since the start of a run [J]."""

    kinetic: float  # Energy of motion
    internal: float  # Strain energy, stretching and bending
    contact: float  # Stored in the penalty springs, normal and stick
    external: float  # Work done on the model: drum, guide, span tension, energy of fed cable
    friction: float  # Turned to heat by sliding
    damping: float  # Taken by mass-proportional damping, contact dashpots, viscosity
    initial: float = 0.0  # Energy stored at the start
    relaxation: float = 0.0  # Turned to heat in the cable, whose stress fades

    @classmethod
    def of(
        cls,
        entries: NDArray[np.float64],
        *,
        kinetic: float,
        internal: float,
        contact: float,
        initial: float,
    ) -> EnergyLedger:
        """Return the ledger of what is stored and of a kernel's entries, shape (LEDGER_SIZE,)."""
        work = entries[WORK_TIE] + entries[WORK_SURFACE] + entries[WORK_SPAN] + entries[WORK_INFLOW]
        return cls(
            kinetic=kinetic,
            internal=internal,
            contact=contact,
            external=float(work),
            friction=float(entries[LOSS_FRICTION]),
            damping=float(entries[LOSS_CONTACT] + entries[LOSS_DAMPING]),
            initial=initial,
            relaxation=float(entries[LOSS_RELAXATION]),
        )

    @property
    def residual(self) -> float:
        """Energy that the ledger cannot explain [J]."""
        present = self.kinetic + self.internal + self.contact
        heat = self.friction + self.damping + self.relaxation
        return present + heat - self.external - self.initial

    @property
    def balance_pct(self) -> float:
        """Residual in percent of the greatest energy in the ledger."""
        greatest = max(
            abs(value)
            for value in (
                self.kinetic,
                self.internal,
                self.external,
                self.friction,
                self.damping,
                self.initial,
                self.relaxation,
            )
        )
        return 100.0 * abs(self.residual) / greatest if greatest > 0.0 else 0.0

    @property
    def kinetic_over_internal(self) -> float:
        """Kinetic over internal energy; small in a quasi-static run."""
        return self.kinetic / self.internal if self.internal > 0.0 else 0.0


class SolverError(RuntimeError):
    """A run has no result that could be trusted."""


class DivergenceError(SolverError):
    """The integration left the range of physics; the message names time, element and cause."""


class EnergyBalanceError(SolverError):
    """A run's energy balance is open: its numbers cannot be trusted."""


class ImpossibleResultError(SolverError):
    """A run ended with cable that cannot lie so."""


@dataclass(frozen=True, kw_only=True)
class CylinderContact:
    """A rigid cylinder at rest about the z axis that nodes cannot enter."""

    # Distance of a touching node from the axis [m]: R + r for a rod's centreline, R for the nodes
    # of a solid's surface.
    reach: float
    friction: float = Condition.friction  # Coulomb friction; acts where the node is

    def __post_init__(self) -> None:
        if not self.reach > 0.0:
            raise ValueError(f"reach must be positive, got {self.reach} m")
        if not self.friction >= 0.0:
            raise ValueError(f"friction must not be negative, got {self.friction}")


def penalty(
    normal: float, mass: float, *, friction: float, stick_share: float, cable_radius: float = 0.0
) -> ContactLaw:
    """Return the contact of a penalty spring [N/m] that holds a node of a mass [kg].

    A fifth of critical damping in the normal direction, a tenth along the surface; the stick
    spring is a share of the normal one.
    """
    stick = stick_share * normal
    return ContactLaw(
        normal_stiffness=normal,
        normal_damping=0.4 * math.sqrt(normal * mass),
        beside_stiffness=BESIDE * normal,
        beside_damping=0.4 * math.sqrt(BESIDE * normal * mass),
        stick_stiffness=stick,
        stick_damping=0.2 * math.sqrt(stick * mass),
        friction=friction,
        cable_radius=cable_radius,
    )
