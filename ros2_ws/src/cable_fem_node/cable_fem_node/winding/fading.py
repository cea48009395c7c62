"""Cable that is held at its stretch fades in closed form, whatever the time between two looks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cable_fem_node.dynamics.points import FloatArray
from cable_fem_node.rod.relaxation import branches_energy
from cable_fem_node.rod.rod_arrays import AxialResponse, Relaxation
from cable_fem_node.winding.resolved_model import ResolvedModel


@dataclass(frozen=True, kw_only=True)
class HeldCable:
    """Elements that friction holds on the cylinder, as views into their arrays.

    Attributes:
        stretch: Of the elements, shape (n,).
        reference: Their lengths [m], shape (n,).
        viscous: Elastic force and every branch's q [N], shape (1 + terms, n), changed.
        radius: Of the node behind each element [m], shape (n,).
        contact_radius: At which that node touches [m], shape (n,), changed.
    """

    stretch: FloatArray
    reference: FloatArray
    viscous: FloatArray
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

    @classmethod
    def of(cls, resolved: ResolvedModel) -> Fading:
        """Return how a model's cable fades."""
        k = resolved.constants
        return cls(
            relax=resolved.relaxation,
            response=resolved.axial,
            sink=1.0 / (k.contact_line * k.touch.normal_stiffness),
            stiffness=k.touch.normal_stiffness,
        )

    @property
    def rows(self) -> int:
        """Count of an element's rows: its elastic force, and every branch's q."""
        return 1 + self.relax.share.size

    def viscous(self, span: float, rows: FloatArray) -> FloatArray:
        """Return every branch's q after a time [s] at a held stretch [N], shape (terms, n).

        Args:
            span: The time [s].
            rows: As `HeldCable.viscous` [N], shape (1 + terms, n).
        """
        full = self.relax.share[:, None] * rows[0]
        left = np.exp(-span / self.relax.time)[:, None]
        return np.asarray(full + left * (rows[1:] - full))

    def fade(self, span: float, cable: HeldCable) -> float:
        """Let a time [s] pass; return the energy that has become heat [J].

        Nodes stay where they are: the spring below them is shortened as their tension fades.
        """
        before = self._energy(cable)
        branches = cable.viscous[1:]
        later = self.viscous(span, cable.viscous)
        change = (later - branches).sum(axis=0)
        branches[:] = later
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
