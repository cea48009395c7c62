"""What defines a winding model: the case, the law, the mesh, the contact and the damping."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

from cable_fem_node.winding.resolved_model import ResolvedModel
from cable_fem_node.winding.validity import checks_of, refuse
from winding_core.cable.cases import Case
from winding_core.cable.condition import Condition, ResolvedCondition
from winding_core.cable.material_law import LawParameters, MaterialLaw
from winding_core.helix import PAPER_FREE_LENGTH
from winding_core.machine.drum import Drum
from winding_core.machine.tension import DeadWeight, TensionLaw
from winding_core.run_options import SolverOptions

# Factors on the density where none is given. The solid's steps are so short that its true mass
# takes hours; its factor was raised until the laid path began to move.
MASS_SCALING = {"rod": 1.0, "solid": 400.0}


@dataclass(frozen=True, kw_only=True)
class WindingConfig(LawParameters):
    """Everything that defines a winding model; its material law is that of `LawParameters`."""

    case: Case  # Cable, cylinder, weight and marker spacing
    # Coulomb friction between cable and cylinder, acting on the centreline.
    friction: float = Condition.friction
    # Reference length of an element [m]; None: what suits the winding.
    segment_length: float | None = None
    free_length: float = PAPER_FREE_LENGTH  # Tangent span between contact line and guide [m], L_xy
    # Span tension from weight, cylinder diameter and wound length.
    tension_law: TensionLaw = field(default_factory=DeadWeight)
    # Whether the wound radius is R + r t with the law's lateral stretch t, or R + r. None: only for
    # the large-strain laws; ``linear`` leaves the section as it is.
    thinning: bool | None = None
    damping_ratio: float = 0.05  # Mass-proportional damping of the span's first axial mode
    mass_scaling: float = 1.0  # Factor on the density
    rolling: bool = False  # Let the cable roll on the surface about its own axis
    # Whether turns of the rod that lie still are laid to rest, which costs nothing but their
    # memory, or are integrated for ever.
    rests: bool = True
    # Flanges, between which cable lies on cable; None for turns that do not know each other
    drum: Drum | None = None

    def __post_init__(self) -> None:
        for name in ("segment_length", "free_length", "mass_scaling"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be positive and finite, got {value}")
        for name in ("friction", "damping_ratio"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} must not be negative, got {value}")
        if self.drum is not None and self.drum.radius != self.case.cylinder_radius:
            raise ValueError(
                f"the drum's radius must be the cylinder's of {self.case.cylinder_radius:g} m, "
                f"got {self.drum.radius:g} m"
            )
        # Refuses a material that cannot carry the weight.
        refuse(checks_of(self.resolved))

    @cached_property
    def resolved(self) -> ResolvedModel:
        """What follows from the configuration, computed once."""
        case, law = self.case, self.tension_law
        tension, built_up = (law(case.weight, case.cylinder_diameter, s) for s in (0.0, math.inf))
        return ResolvedModel.of(
            case,
            self.material_law(case.material.young, case.material.poisson),
            tension=tension,
            lowest_tension=min(tension, built_up),
            thins=self.thins,
            friction=self.friction,
            free_length=self.free_length,
            segment_length=self.segment_length,
            damping_ratio=self.damping_ratio,
            mass_scaling=self.mass_scaling,
            rolling=self.rolling,
            drum=self.drum,
        )

    @property
    def thins(self) -> bool:
        """Whether the wound radius follows the cable's lateral stretch."""
        return self.law != "linear" if self.thinning is None else self.thinning

    def with_law(self, law: MaterialLaw) -> WindingConfig:
        """Return the configuration with another material; density and friction stay.

        Raises:
            ValueError: The material cannot carry the weight.
        """
        material = replace(self.case.material, young=law.young, poisson=law.poisson)
        return replace(self, case=replace(self.case, material=material), **law.law_values())

    def refuse_rod_material(self) -> None:
        """Refuse what a solid element does not have.

        Raises:
            ValueError: A stiffness factor is not 1, the law has no stored energy, or there is a
                Prony series or a drum.
        """
        material = self.case.material
        for name in ("axial_factor", "bending_factor"):
            value = getattr(material, name)
            if value != 1.0:
                raise ValueError(
                    f"the solid element has no separate stiffnesses: {name} must be 1, got {value}"
                )
        if material.yield_stress:
            raise ValueError("the solid element knows elastic cables alone: leave out yield_stress")
        material.refuse_fading("the solid element")
        if self.law == "hencky_cauchy":
            raise ValueError("the solid element needs a law with stored energy: take law hencky")
        if self.drum is not None:
            raise ValueError("the solid element lies on a bare cylinder: leave out the drum")


@dataclass(frozen=True, kw_only=True)
class SolverParameters(SolverOptions):
    """The solver's options, and the model that they make of a condition."""

    @property
    def scaling(self) -> float:
        """Factor on the density."""
        return self.mass_scaling or MASS_SCALING[self.element]

    def config_of(self, what: ResolvedCondition) -> WindingConfig:
        """Return the model of a condition.

        Raises:
            ValueError: The condition cannot be wound with this mesh, or the material cannot
                carry the weight.
        """
        return WindingConfig(
            case=what.case,
            friction=what.friction,
            tension_law=what.tension_law,
            free_length=what.free_length,
            segment_length=self.segment_length or None,
            mass_scaling=self.scaling,
            rolling=self.rolling,
            **what.law_values(),
        )
