"""What defines a winding model: the case, the law, the mesh, the contact and the damping."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

from cable_fem_node.winding.resolved_model import ResolvedModel
from cable_fem_node.winding.validity import checks_of, refuse
from winding_core.cable.cases import Case
from winding_core.cable.condition import Condition, ResolvedCondition
from winding_core.cable.material_law import MOONEY_RATIO
from winding_core.helix import PAPER_FREE_LENGTH
from winding_core.machine.tension import DeadWeight, TensionLaw
from winding_core.parameters import parameter
from winding_core.units import LENGTH, PLAIN


@dataclass(frozen=True, kw_only=True)
class WindingConfig:
    """Everything that defines a winding model.

    Attributes:
        case: Cable, cylinder, weight and marker spacing.
        friction: Coulomb friction between cable and cylinder, acting on the centreline.
        law: Material law, one of material_law.LAWS.
        mooney_ratio: C01 / C10 of law ``mooney_rivlin``.
        segment_length: Reference length of an element [m]; None: what suits the winding.
        free_length: Tangent span between contact line and guide [m], L_xy.
        tension_law: Span tension from weight, cylinder diameter and wound length.
        thinning: Whether the wound radius is R + r t with the law's lateral stretch t, or
            R + r. None: only for the large-strain laws; ``linear`` leaves the section as it is.
        damping_ratio: Mass-proportional damping of the span's first axial mode.
        mass_scaling: Factor on the density.
        rolling: Let the cable roll on the surface about its own axis.
        rests: Whether turns of the rod that lie still are laid to rest, which costs nothing but
            their memory, or are integrated for ever.
    """

    case: Case
    friction: float = Condition.friction
    law: str = Condition.law
    segment_length: float | None = None
    free_length: float = PAPER_FREE_LENGTH
    tension_law: TensionLaw = field(default_factory=DeadWeight)
    thinning: bool | None = None
    damping_ratio: float = 0.05
    mass_scaling: float = 1.0
    rolling: bool = False
    mooney_ratio: float = MOONEY_RATIO
    rests: bool = True

    def __post_init__(self) -> None:
        for name in ("segment_length", "free_length", "mass_scaling"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be positive and finite, got {value}")
        for name in ("friction", "damping_ratio"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} must not be negative, got {value}")
        # Refuses a material that cannot carry the weight.
        refuse(checks_of(self, self.resolved))

    @cached_property
    def resolved(self) -> ResolvedModel:
        """What follows from the configuration, computed once."""
        return ResolvedModel.of(self)

    def refuse_rod_material(self) -> None:
        """Refuse what a solid element does not have: factors on stiffnesses, a Prony series.

        Raises:
            ValueError: A factor is not 1, or there is a series.
        """
        material = self.case.material
        for name in ("axial_factor", "bending_factor"):
            value = getattr(material, name)
            if value != 1.0:
                raise ValueError(
                    f"the solid element has no separate stiffnesses: {name} must be 1, got {value}"
                )
        material.refuse_fading("the solid element")


@dataclass(frozen=True, kw_only=True)
class SolverParameters:
    """How the solver winds a condition: mesh, mass scaling and rolling as parameters."""

    segment_length: float = parameter(
        0.0,
        "undeformed length of an element",
        LENGTH,
        0.0001,
        0.05,
        otherwise="what suits cable and cylinder, 5 mm at most",
        option="segment",
    )
    mass_scaling: float = parameter(
        0.0,
        "factor on the cable's density",
        PLAIN,
        1.0,
        1.0e4,
        otherwise="1 with the rod and 400 with the solid",
    )
    rolling: bool = parameter(False, "whether the rod may roll on the cylinder", unit=PLAIN)

    def config_of(self, what: ResolvedCondition, *, mass_scaling: float = 1.0) -> WindingConfig:
        """Return the model of a condition.

        Args:
            what: What is wound.
            mass_scaling: Factor on the density where the parameters leave it open.

        Raises:
            ValueError: The condition cannot be wound with this mesh, or the material cannot
                carry the weight.
        """
        return WindingConfig(
            case=what.case,
            friction=what.friction,
            law=what.law,
            mooney_ratio=what.mooney_ratio,
            tension_law=what.tension_law,
            free_length=what.free_length,
            segment_length=self.segment_length or None,
            mass_scaling=self.mass_scaling or mass_scaling,
            rolling=self.rolling,
        )
