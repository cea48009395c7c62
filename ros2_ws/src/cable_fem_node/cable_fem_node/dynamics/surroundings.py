"""What acts on a model's nodes from outside: loads, constraints, damping, the cylinder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from winding_core.condition import Condition

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class CylinderContact:
    """A rigid cylinder at rest about the z axis that nodes cannot enter.

    Attributes:
        reach: Distance of a touching node from the axis [m]: R + r for a rod's centreline, R for
            the nodes of a solid's surface.
        friction: Coulomb friction; acts where the node is.
        damping: Normal dashpot as a share of the critical one.
    """

    reach: float
    friction: float = Condition.friction
    damping: float = 0.2

    def __post_init__(self) -> None:
        if not self.reach > 0.0:
            raise ValueError(f"reach must be positive, got {self.reach} m")
        if not self.friction >= 0.0:
            raise ValueError(f"friction must not be negative, got {self.friction}")


class Surroundings(NamedTuple):
    """Loads, constraints and damping of a model's nodes."""

    mass: FloatArray  # (nodes,)
    free: FloatArray  # (3, nodes)
    driven: FloatArray  # (3, nodes) [m/s]
    load: FloatArray  # (3, nodes) [N]
    gravity: FloatArray  # (3,)
    load_times: FloatArray
    load_values: FloatArray
    damping_rate: float
    calming: bool  # kinetic damping: stand still whenever the kinetic energy has passed a peak
    reach: float  # radius at which nodes touch the cylinder; negative without one


class Touch(NamedTuple):
    """Constants of the contact, per node."""

    normal_stiffness: float
    normal_damping: float
    stick_stiffness: float
    stick_damping: float
    friction: float
    cable_radius: float
