"""What a winding rod stores: motion, stretching, bending, torsion."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cable_fem_node.dynamics.points import FloatArray, Points
from cable_fem_node.rod.relaxation import branches_energy
from cable_fem_node.rod.rod_kernels import bending_energy, stored_energy
from cable_fem_node.winding.resolved_model import ResolvedModel
from cable_fem_node.winding.winding_model import geodesic_twist


@dataclass(frozen=True, kw_only=True)
class WholeRod:
    """All nodes and elements of a rod, resting or not.

    Attributes:
        cable: The nodes.
        reference: Lengths of the elements [m], shape (nodes,).
        viscous: Elastic and viscous forces of the elements [N]; no rows for an elastic cable.
        angle: Of the cylinder [rad], whose surface clamps the cable at P0.
    """

    cable: Points
    reference: FloatArray
    viscous: FloatArray
    angle: float

    def stored(self, resolved: ResolvedModel, *, rolling: bool) -> float:
        """Return what stretching, bending and torsion store [J]; the element at the guide is fed.

        Args:
            resolved: The model.
            rolling: Whether the cable may roll about its axis.
        """
        k, axial = resolved.constants, resolved.axial
        cable, reference = self.cable, self.reference
        elements = cable.touching.size - 2
        stretching = stored_energy(elements, cable.position, reference, axial)
        edges = np.diff(cable.position, axis=1)
        lengths = np.sqrt((edges**2).sum(axis=0))
        if self.viscous.size:
            stretch = lengths[:elements] / reference[:elements]
            stretching += branches_energy(
                stretch, reference, self.viscous, axial, resolved.relaxation
            )
        tangents = edges / lengths
        cosine = np.ones(elements + 2)
        cosine[1:-1] = (tangents[:, 1:] * tangents[:, :-1]).sum(axis=0)
        clamp = math.sin(self.angle) * tangents[0, 0] - math.cos(self.angle) * tangents[1, 0]
        turned_by = math.acos(min(1.0, clamp)) ** 2
        clamped = k.bending * turned_by / float(reference[0])
        bending = bending_energy(elements + 1, reference, k.bending, cosine) + clamped
        twisting = 0.0
        if rolling:
            wound = (cable.touching[:-1] == 1) & (cable.touching[1:] == 1)
            own = geodesic_twist(tangents, k.contact_line)
            twist = np.diff(cable.roll[0]) / k.segment + np.where(wound, own, 0.0)
            twisting = 0.5 * k.torsion * k.segment * float((twist[:-1] ** 2).sum())
        return stretching + bending + twisting


def kinetic_energy(cable: Points, resolved: ResolvedModel, end: int) -> float:
    """Return the kinetic energy [J] of nodes 1 to `end` - 1."""
    k, moving = resolved.constants, slice(1, end)
    return 0.5 * k.mass * float((cable.velocity[:, moving] ** 2).sum()) + (
        0.5 * k.roll_inertia * float((cable.roll[1, moving] ** 2).sum())
    )
