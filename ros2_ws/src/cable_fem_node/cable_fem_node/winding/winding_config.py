"""What defines a winding model: the case, the law, the mesh, the contact and the damping."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from winding_core.cases import Case
from winding_core.condition import Condition
from winding_core.fleet_angle import PAPER_FREE_LENGTH
from winding_core.material_law import MOONEY_RATIO, MaterialLaw
from winding_core.tension import DeadWeight, TensionLaw


@dataclass(frozen=True, kw_only=True)
class WindingConfig:
    """Everything that defines a winding model.

    Attributes:
        case: Cable, cylinder, weight and marker spacing.
        friction: Coulomb friction between cable and cylinder, acting on the centreline.
        law: Material law, one of uniaxial.LAWS.
        mooney_ratio: C01 / C10 of law ``mooney_rivlin``.
        segment_length: Reference length of an element [m].
        free_length: Tangent span between contact line and guide [m], L_xy.
        tension_law: Span tension from weight, cylinder diameter and wound length.
        thinning: Whether the wound radius is R + r t with the law's lateral stretch t, or
            R + r. None: only for the large-strain laws; ``linear`` leaves the section as it is.
        damping_ratio: Mass-proportional damping of the span's first axial mode.
        mass_scaling: Factor on the density.
        rolling: Let the cable roll on the surface about its own axis.
    """

    case: Case
    friction: float = Condition.friction
    law: str = Condition.law
    segment_length: float = 5.0e-3
    free_length: float = PAPER_FREE_LENGTH
    tension_law: TensionLaw = field(default_factory=DeadWeight)
    thinning: bool | None = None
    damping_ratio: float = 0.05
    mass_scaling: float = 1.0
    rolling: bool = False
    mooney_ratio: float = MOONEY_RATIO

    def __post_init__(self) -> None:
        for name in ("segment_length", "free_length", "mass_scaling"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be positive and finite, got {value}")
        for name in ("friction", "damping_ratio"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} must not be negative, got {value}")
        if self.segment_length > 0.3 * self.free_length:
            raise ValueError(
                f"segment_length must be at most 0.3 of the free length "
                f"{self.free_length:g} m, got {self.segment_length:g} m"
            )
        self.uniaxial.stretch_at(self.weight_tension / self.case.section_area)

    @property
    def uniaxial(self) -> MaterialLaw:
        """The material law in uniaxial tension."""
        material = self.case.material
        return MaterialLaw(
            law=self.law,
            young=material.young,
            poisson=material.poisson,
            mooney_ratio=self.mooney_ratio,
        )

    @property
    def weight_tension(self) -> float:
        """Span tension at the start [N]."""
        return self.tension_law(self.case.weight, self.case.cylinder_diameter, 0.0)

    @property
    def thins(self) -> bool:
        """Whether the wound radius follows the cable's lateral stretch."""
        return self.law != "linear" if self.thinning is None else self.thinning

    @property
    def bending_stiffness(self) -> float:
        """EI of the undeformed section [N m^2]."""
        return self.case.bending_stiffness

    def wound_radius(self, stretch: float) -> float:
        """Return the centreline radius [m] of cable wound at a stretch."""
        lateral = float(self.uniaxial.lateral_stretch(stretch)) if self.thins else 1.0
        return self.case.cylinder_radius + self.case.cable_radius * lateral

    def wound_tension(self, span_tension: float) -> float:
        """Return the tension [N] of the wound cable: F - EI l / (2 rho^2).

        The cable bends at the cost of its own tension where it comes to lie on the cylinder
        (l stretch, rho centreline radius); curvature counts per reference length.
        """
        stretch = self.uniaxial.stretch_at(span_tension / self.case.section_area)
        radius = self.wound_radius(stretch)
        return span_tension - 0.5 * self.bending_stiffness * stretch / radius**2

    def wound_stretch(self, span_tension: float) -> float:
        """Return the closed-form stretch of the wound cable under a span tension [N]."""
        return self.uniaxial.stretch_at(self.wound_tension(span_tension) / self.case.section_area)
