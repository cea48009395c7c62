"""Contact of nodes with a rigid cylinder: its constants, forces and energy."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cable_fem_node.dynamics.points import ContactLaw, FloatArray, Points
from winding_core.condition import Condition


@dataclass(frozen=True, kw_only=True)
class CylinderContact:
    """A rigid cylinder at rest about the z axis that nodes cannot enter.

    Attributes:
        reach: Distance of a touching node from the axis [m]: R + r for a rod's centreline, R for
            the nodes of a solid's surface.
        friction: Coulomb friction; acts where the node is.
    """

    reach: float
    friction: float = Condition.friction

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
        stick_stiffness=stick,
        stick_damping=0.2 * math.sqrt(stick * mass),
        friction=friction,
        cable_radius=cable_radius,
    )


def normal_forces(points: Points, touch: ContactLaw) -> FloatArray:
    """Return with which force [N] the penalty spring of every node pushes, shape (nodes,)."""
    radius = np.hypot(points.position[0], points.position[1])
    depth = np.where(points.touching == 1, points.contact_radius - radius, 0.0)
    return np.asarray(touch.normal_stiffness * np.maximum(depth, 0.0))


def contact_energy(points: Points, touch: ContactLaw, nodes: int | None = None) -> float:
    """Return the energy [J] in the normal and stick springs of the first nodes, or of all."""
    touching = np.flatnonzero(points.touching[:nodes])
    radius = np.hypot(points.position[0, touching], points.position[1, touching])
    depth = np.maximum(points.contact_radius[touching] - radius, 0.0)
    normal = 0.5 * touch.normal_stiffness * float((depth**2).sum())
    stick = 0.5 * touch.stick_stiffness * float((points.slip[:, touching] ** 2).sum())
    return normal + stick
