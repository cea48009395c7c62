"""What acts on a model's nodes from outside: loads, constraints, damping, the cylinder."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class Surroundings(NamedTuple):
    """Loads, constraints and damping of a model's nodes."""

    mass: FloatArray  # (nodes,)
    free: FloatArray  # (3, nodes)
    driven: FloatArray  # (3, nodes) [m/s]
    load: FloatArray  # (3, nodes) [N]
    gravity: FloatArray  # (3,)
    load_times: FloatArray
    load_values: FloatArray
    drive_times: FloatArray
    drive_values: FloatArray
    damping_rate: float
    calming: bool  # kinetic damping: stand still whenever the kinetic energy has passed a peak
    reach: float  # radius at which nodes touch the cylinder; negative without one
    angular_speed: float


class Touch(NamedTuple):
    """Constants of the contact, per node."""

    normal_stiffness: float
    normal_damping: float
    stick_stiffness: float
    stick_damping: float
    friction: float
    cable_radius: float
