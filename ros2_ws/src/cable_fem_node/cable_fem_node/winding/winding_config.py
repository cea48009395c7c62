"""What defines a winding model: the case, the law, the mesh, the contact and the damping."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

from cable_fem_node.dynamics.state import penalty
from cable_fem_node.rod.rod_records import MERGE_AT, Constants
from cable_fem_node.winding.resolved_model import (
    LEAST_STRAIN,
    STEP_SAFETY,
    STIFF,
    STILL_SHARE,
    STIRRED_SHARE,
    ResolvedModel,
    chord_radius,
    chosen_segment,
)
from cable_fem_node.winding.validity import checks_of, refuse
from winding_core.cable.cases import Case
from winding_core.cable.condition import Condition, ResolvedCondition
from winding_core.cable.material_law import LawParameters, MaterialLaw, NoEquilibriumError
from winding_core.helix import PAPER_FREE_LENGTH
from winding_core.machine.drum import Drum
from winding_core.machine.tension import DeadWeight, TensionLaw
from winding_core.run_options import SolverOptions

# Factors on the density where none is given. The solid's steps are so short that its true mass
# takes hours; its factor was raised until the laid path began to move.
MASS_SCALING = {"rod": 1.0, "solid": 400.0}
# The contact spring is six times as stiff as a segment, or stiffer where the cable would sink in
# by more than this share of the radius.
_SINK_SHARE = 0.005


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
        return _resolved(self)

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


def _resolved(config: WindingConfig) -> ResolvedModel:
    """Return what follows from a configuration.

    Raises:
        NoEquilibriumError: The law cannot carry the weight at any stretch.
        ValueError: The weight stretches the cable beyond the tables.
    """
    case, free_length, mass_scaling = config.case, config.free_length, config.mass_scaling
    law = config.material_law(case.material.young, case.material.poisson)
    tension, built_up = (
        config.tension_law(case.weight, case.cylinder_diameter, s) for s in (0.0, math.inf)
    )
    lowest_tension = min(tension, built_up)
    stretch = law.stretch_at(tension / case.axial_area)
    _refuse_endless_creep(law, case, tension)
    lateral = float(law.lateral_stretch(stretch))
    radius = case.cylinder_radius + case.cable_radius * (lateral if config.thins else 1.0)
    lowest = max(lowest_tension, 1.0e-300)
    bending_share = 0.5 * case.bending_stiffness * stretch / (lowest * radius**2)
    h = config.segment_length or chosen_segment(law, stretch, bending_share, radius, free_length)
    mass = mass_scaling * case.material.density * case.section_area * h
    axial = case.material.young * case.axial_area / h
    normal = max(6.0 * axial, tension * stretch * h / (_SINK_SHARE * radius**2))
    wave = math.sqrt(
        case.material.axial_factor * case.material.young / (mass_scaling * case.material.density)
    )
    first_mode = 0.5 * math.pi * wave / free_length
    polar = 0.5 * math.pi * case.cable_radius**4
    chords = chord_radius(radius, stretch * h)
    touch = penalty(
        normal, mass, friction=config.friction, stick_share=0.25, cable_radius=case.cable_radius
    )._replace(line=radius, chords=chords, apart=2.0 * (radius - case.cylinder_radius))
    if config.drum is not None:
        low, high = config.drum.centre_lines(case.cable_diameter)
        touch = touch._replace(low=low, high=high, rim=config.drum.flange_radius)
    constants = Constants(
        segment=h,
        mass=mass,
        bending=case.bending_stiffness,
        touch=touch,
        damping_rate=2.0 * config.damping_ratio * first_mode,
        start_radius=chords,
        contact_line=radius,
        free_length=free_length,
        roll_inertia=0.5 * mass * case.cable_radius**2,
        torsion=law.shear_modulus * polar,
        stirred=STIRRED_SHARE * max(abs(stretch - 1.0), LEAST_STRAIN) * h,
        rolling=config.rolling,
        late=int(bending_share > STIFF),
    )
    return ResolvedModel(
        case=case,
        law=law,
        thins=config.thins,
        tension=tension,
        lowest_tension=lowest_tension,
        stretch=stretch,
        lateral=lateral,
        wound_radius=radius,
        segment=h,
        bending_share=bending_share,
        mass_scaling=mass_scaling,
        constants=constants,
        step=_stable_step(case.axial_area, law, tension, stretch, constants),
        still=STILL_SHARE / STIRRED_SHARE * constants.stirred,
    )


def _refuse_endless_creep(law: MaterialLaw, case: Case, tension: float) -> None:
    left = case.material.prony.left
    if left == 1.0:
        return
    try:
        law.stretch_at(tension / (left * case.axial_area))
    except ValueError as error:
        raise NoEquilibriumError(
            f"prony leaves {left:.4g} of the stress, so {tension:.4g} N end as "
            f"{tension / left:.4g} N would at once: {error}"
        ) from error


def _stable_step(
    area: float, law: MaterialLaw, tension: float, stretch: float, k: Constants
) -> float:
    tangent = max(law.tangent(1.0), law.tangent(stretch))
    along = 4.0 * tangent * area / k.segment + k.touch.stick_stiffness
    short = 0.5 * (1.0 + MERGE_AT)
    across = (
        k.touch.normal_stiffness
        + 16.0 * k.bending / (short * k.segment**3)
        + 8.0 * tension / (stretch * k.segment)
    )
    return STEP_SAFETY * 2.0 * math.sqrt(k.mass / max(along, across))


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
