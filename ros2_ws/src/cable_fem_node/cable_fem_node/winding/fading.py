"""Cable that is held at its stretch fades in closed form, whatever the time between two looks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cable_fem_node.dynamics.points import FloatArray
from cable_fem_node.rod.relaxation import branches_energy
from cable_fem_node.rod.rod_arrays import AxialResponse, Relaxation


@dataclass(frozen=True, kw_only=True)
class HeldCable:
    """Elements that friction holds on the cylinder, as views into their arrays.

    Attributes:
        stretch: Of the elements, shape (n,).
        reference: Their lengths [m], shape (n,).
        viscous: Elastic force and every branch's q [N], shape (1 + terms, n), changed.
        tension: [N], shape (n,), changed.
        radius: Of the node behind each element [m], shape (n,).
        contact_radius: At which that node touches [m], shape (n,), changed.
    """

    stretch: FloatArray
    reference: FloatArray
    viscous: FloatArray
    tension: FloatArray
    radius: FloatArray
    contact_radius: FloatArray


@dataclass(frozen=True, kw_only=True)
class Fading:
    """How held cable fades.

    Attributes:
        relax: Of the cable.
        response: Its axial response.
        sink: How much deeper a node lies for each newton of tension and metre of length [1/N].
        stiffness: Of the penalty spring that it lies on [N/m].
    """

    relax: Relaxation
    response: AxialResponse
    sink: float
    stiffness: float

    def fade(self, span: float, cable: HeldCable) -> float:
        """Let a time [s] pass; return the energy that has become heat [J].

        Nodes stay where they are: the spring below them is shortened as their tension fades.
        """
        before = self._energy(cable)
        branches = cable.viscous[1:]
        old = branches.sum(axis=0)
        full = self.relax.share[:, None] * cable.viscous[0]
        left = np.exp(-span / self.relax.time)[:, None]
        branches[:] = full + left * (branches - full)
        change = branches.sum(axis=0) - old
        cable.tension[:] -= change
        less = self.sink * change * cable.stretch * cable.reference
        depth = cable.contact_radius - cable.radius
        cable.contact_radius[:] -= less
        pressed = 0.5 * self.stiffness * float(((2.0 * depth - less) * less).sum())
        return before - self._energy(cable) + pressed

    def _energy(self, cable: HeldCable) -> float:
        return float(
            branches_energy(
                cable.stretch, cable.reference, cable.viscous, self.response, self.relax
            )
        )
