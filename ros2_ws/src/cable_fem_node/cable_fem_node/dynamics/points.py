"""Nodes in motion and in contact, and the ledger that every explicit model keeps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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


class ContactLaw(NamedTuple):
    """Constants of the contact with the cylinder, per node."""

    normal_stiffness: float  # push for each metre of depth [N/m]
    normal_damping: float  # push for each metre per second [N s/m]
    stick_stiffness: float  # friction for each metre of the stick spring [N/m]
    stick_damping: float  # friction for each metre per second while sticking [N s/m]
    friction: float  # Coulomb's coefficient
    cable_radius: float  # undeformed [m]


def empty_points(capacity: int) -> Points:
    """Return the arrays of so many nodes, at rest in the origin."""
    return Points(
        position=np.zeros((3, capacity)),
        velocity=np.zeros((3, capacity)),
        slip=np.zeros((2, capacity)),
        contact_radius=np.zeros(capacity),
        touching=np.zeros(capacity, dtype=np.int64),
        roll=np.zeros((2, capacity)),
    )
