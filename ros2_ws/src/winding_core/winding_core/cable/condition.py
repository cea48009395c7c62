"""What is wound, and how: the one record that nodes, commands, sweeps and the page share."""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from winding_core.cable.cases import Case, Material, paper_case, published_conditions
from winding_core.cable.material_law import LawParameters
from winding_core.cable.prony import PronySeries
from winding_core.helix import PAPER_FREE_LENGTH, free_length_of, guide_distance_of
from winding_core.machine.drive import (
    PAPER_ANGULAR_SPEED,
    PAPER_DURATION,
    PAPER_FEED_SPEED,
    PAPER_RAMP_TIME,
    DriveProfile,
)
from winding_core.machine.tension import REFERENCE_DIAMETER, DeadWeight, RigTension
from winding_core.parameters import (
    ParameterError,
    Spelling,
    Value,
    options,
    parameter,
    shown_values,
    typed_values,
)
from winding_core.units import (
    ANGULAR_SPEED,
    DENSITY,
    FORCE,
    LENGTH,
    MILLIMETRE,
    PLAIN,
    SPEED,
    STRESS,
    TIME,
)

# The paper's markers are spaced like this on most cables [m].
OWN_MARKER_SPACING = 0.1
_CASE_VALUE = "the case's"
# Of these options the one that is given replaces the other.
ALTERNATIVES = (("tension_n", "tension_mpa"), ("free_length_mm", "guide_distance_mm"))
# Any of these without a case defines a condition that is not the paper's.
OWN = ("cylinder_diameter", "cable_diameter", "weight", "nominal_stress", "marker_spacing")


@dataclass(frozen=True, kw_only=True)
class CableAndLoad:
    """Cylinder, cable, weight and markers. A value of 0 beside a case stands for the case's own."""

    case: int = parameter(
        4, "row of the paper's Table 1", low=1, unit=PLAIN, otherwise="another cable"
    )
    cylinder_diameter: float = parameter(
        0.0, "cylinder diameter", LENGTH, 1.0e-3, 2.0, otherwise=_CASE_VALUE
    )
    cable_diameter: float = parameter(
        0.0, "undeformed cable diameter", LENGTH, 2.0e-5, 0.1, otherwise=_CASE_VALUE
    )
    weight: float = parameter(
        0.0,
        "dead weight on the cable's end",
        FORCE,
        1.0e-4,
        1.0e6,
        option="tension",
        otherwise=_CASE_VALUE,
    )
    nominal_stress: float = parameter(
        0.0,
        "dead weight over the undeformed section, instead of the weight",
        STRESS,
        1.0e2,
        1.0e10,
        option="tension",
        otherwise="the weight",
    )
    marker_spacing: float = parameter(
        0.0,
        "marker spacing along the undeformed cable",
        LENGTH,
        1.0e-3,
        100.0,
        otherwise=f"the case's, or {OWN_MARKER_SPACING / MILLIMETRE:g} mm",
    )
    markers: int = parameter(Case.marker_count, "count of markers after P0", PLAIN, 1, 64)
    young: float = parameter(
        Material.young, "Young's modulus", STRESS, 1.0e3, 1.0e12, label="Young's modulus"
    )
    poisson: float = parameter(
        Material.poisson, "Poisson's ratio", PLAIN, 0.0, 0.4999, label="Poisson's ratio"
    )
    density: float = parameter(Material.density, "mass density", DENSITY, 1.0, 3.0e4)
    axial_factor: float = parameter(
        Material.axial_factor, "factor on the axial stiffness EA", PLAIN, 1.0e-3, 1.0e3
    )
    bending_factor: float = parameter(
        Material.bending_factor, "factor on the bending stiffness EI", PLAIN, 1.0e-7, 1.0e3
    )
    bending_limit: float = parameter(
        0.0,
        "largest strain d / (D + d) that bending may give the outer fibre, dimensionless",
        PLAIN,
        1.0e-5,
        10.0,
        otherwise="not known",
    )
    yield_stress: float = parameter(
        0.0,
        "stress at which bending makes the outer fibre yield",
        STRESS,
        1.0e3,
        1.0e10,
        option="yield",
        otherwise="it does not yield",
    )
    prony: str = parameter(
        "",
        "how the stress of the stretched cable fades: terms share:seconds joined by +, as "
        "0.2:1.5+0.1:30, with the modulus at once as Young's; empty for an elastic cable",
        PLAIN,
        label="Relaxation share:seconds",
    )

    def wound_case(self, spelled: Mapping[str, str]) -> Case:
        """Return the case that the parameters name or spell out.

        Raises:
            ParameterError: Values are missing or contradict each other.
        """
        if self.weight and self.nominal_stress:
            raise ParameterError(
                f"give the tension once: {spelled['weight']} or {spelled['nominal_stress']}"
            )
        start = published_case(self.case, spelled["case"]) if self.case else None
        given: dict[str, Any] = {
            name: getattr(self, name)
            for name in ("cylinder_diameter", "cable_diameter", "marker_spacing", "weight")
            if getattr(self, name)
        }
        if self.nominal_stress:
            diameter = given.get("cable_diameter", start.cable_diameter if start else 0.0)
            given["weight"] = self.nominal_stress * math.pi * diameter**2 / 4.0
        given["marker_count"] = self.markers
        given["material"] = Material(
            young=self.young,
            poisson=self.poisson,
            density=self.density,
            axial_factor=self.axial_factor,
            bending_factor=self.bending_factor,
            bending_limit=self.bending_limit,
            yield_stress=self.yield_stress,
            prony=self._prony(spelled["prony"]),
        )
        if start is None:
            _refuse_missing(given, spelled)
            given.setdefault("marker_spacing", OWN_MARKER_SPACING)
            return Case(**given)
        case = dataclasses.replace(start, **given)
        same = dataclasses.replace(case, marker_count=start.marker_count) == start
        return case if same else dataclasses.replace(case, number=0)

    def _prony(self, name: str) -> PronySeries:
        try:
            return PronySeries.parse(self.prony)
        except ValueError as error:
            raise ParameterError(str(error).replace("prony", name, 1)) from error


def published_case(number: object, name: str) -> Case:
    """Return a case of Table 1.

    Raises:
        ParameterError: There is no such case.
    """
    known = published_conditions()
    if not isinstance(number, int) or number not in known:
        raise ParameterError(f"{name} must be one of 1 to {len(known)}, got {number}")
    return paper_case(number)


def _refuse_missing(given: Mapping[str, object], spelled: Mapping[str, str]) -> None:
    wanted = {
        "cylinder_diameter": spelled["cylinder_diameter"],
        "cable_diameter": spelled["cable_diameter"],
        "weight": f"{spelled['weight']} or {spelled['nominal_stress']}",
    }
    missing = [words for name, words in wanted.items() if name not in given]
    if missing:
        raise ParameterError(
            f"give {spelled['case']}, or a whole condition: missing {', '.join(missing)}"
        )


@dataclass(frozen=True, kw_only=True)
class ResolvedCondition(LawParameters):
    """A condition with nothing left open [SI]; its law is that of `LawParameters`."""

    case: Case  # Cylinder, cable, material and weight; numbered only when it is the paper's
    drive: DriveProfile  # How the axes move
    duration: float  # Time to wind [s]
    free_length: float  # Tangent span between cylinder and guide [m]
    friction: float  # Coulomb friction of cable on cylinder, dimensionless
    # Span tension from weight, cylinder diameter and wound length.
    tension_law: DeadWeight | RigTension


@dataclass(frozen=True, kw_only=True)
class Condition(LawParameters, CableAndLoad):
    """What is wound, and how.

    Fields with a unit are options of the commands, axes of a sweep and fields of the page.
    """

    friction: float = parameter(
        0.1, "Coulomb friction of cable on cylinder, dimensionless", PLAIN, 0.0, 2.0
    )
    tension_offset: float = parameter(
        RigTension.offset,
        "constant part of the span tension, added to the weight's share",
        FORCE,
        -1.0e6,
        1.0e6,
    )
    tension_share: float = parameter(
        RigTension.weight_share, "share of the weight in the span tension", PLAIN, 0.0, 2.0
    )
    tension_diameter_gain: float = parameter(
        RigTension.diameter_gain,
        "change of the span tension with the cylinder diameter over the reference diameter",
        FORCE,
        -1.0e6,
        1.0e6,
    )
    tension_reference_diameter: float = parameter(
        REFERENCE_DIAMETER,
        "cylinder diameter at which that change is nothing, by default between the paper's two",
        LENGTH,
        1.0e-3,
        2.0,
    )
    tension_start_share: float = parameter(
        RigTension.start_share, "share of the span tension at the start", PLAIN, 0.0, 2.0
    )
    tension_build_up: float = parameter(
        RigTension.build_up_length,
        "wound length over which the span tension builds up from its start, by default the "
        "paper's rig's",
        LENGTH,
        1.0e-3,
        1.0e3,
    )
    angular_speed: float = parameter(
        PAPER_ANGULAR_SPEED,
        "cylinder speed after the ramp",
        ANGULAR_SPEED,
        1.0e-3,
        200.0,
        option="omega",
        label="Cylinder speed",
    )
    feed_speed: float = parameter(
        PAPER_FEED_SPEED,
        "carriage speed after the ramp, negative towards -z",
        SPEED,
        -0.5,
        0.5,
        option="feed",
        label="Carriage speed",
    )
    ramp_time: float = parameter(PAPER_RAMP_TIME, "time of the linear speed ramp", TIME, 0.05, 60.0)
    duration: float = parameter(PAPER_DURATION, "simulated length of a run", TIME, 0.1, 3.6e3)
    free_length: float = parameter(
        PAPER_FREE_LENGTH,
        "tangent span between cylinder and guide, by default the paper's rig's",
        LENGTH,
        0.01,
        50.0,
    )
    guide_distance: float = parameter(
        0.0,
        "distance of the guide from the cylinder axis, instead of the span",
        LENGTH,
        0.01,
        50.0,
        otherwise="the span",
    )

    @classmethod
    def from_typed(
        cls, typed: Mapping[str, object], *, spelling: Spelling = str, case: int | None = None
    ) -> Self:
        """Return the condition that typed options mean.

        Args:
            typed: By option, in the unit of its name; None where nothing was typed.
            spelling: How a refusal writes an option's name.
            case: What is wound when the options do not define it; None to refuse that.

        Raises:
            ParameterError: A value or a combination is refused.
        """
        if typed.get("case") is not None:
            published_case(typed["case"], spelling("case"))
        values: dict[str, Any] = typed_values(cls, typed, spelling)
        if "case" not in values:
            if any(name in values for name in OWN):
                values["case"] = 0
            elif case is not None:
                values["case"] = case
            else:
                raise ParameterError(_undefined(_spelled(cls, spelling)))
        condition = cls(**values)
        # A refusal here can still name the options.
        condition.resolved(spelling)
        return condition

    def resolved(self, spelling: Spelling | None = None) -> ResolvedCondition:
        """Return the condition with nothing left open.

        Args:
            spelling: How a refusal writes an option's name; None: it writes the parameter's.

        Raises:
            ParameterError: Values are missing, contradict each other, or leave the model's range.
        """
        spelled = _spelled(type(self), spelling)
        try:
            case = self.wound_case(spelled)
            return ResolvedCondition(
                case=case,
                drive=DriveProfile(
                    angular_speed=self.angular_speed,
                    feed_speed=self.feed_speed,
                    ramp_time=self.ramp_time,
                ),
                duration=self.duration,
                free_length=self._free_length(case, spelled),
                friction=self.friction,
                tension_law=self._tension_law(),
                **self.law_values(),
            )
        except ValueError as error:
            raise ParameterError(str(error)) from error

    def _free_length(self, case: Case, spelled: Mapping[str, str]) -> float:
        if not self.guide_distance:
            return self.free_length
        if self.free_length != PAPER_FREE_LENGTH:
            raise ParameterError(
                f"give {spelled['guide_distance']} or {spelled['free_length']}, not both"
            )
        if not self.guide_distance > case.centreline_radius:
            raise ParameterError(
                f"{spelled['guide_distance']} must exceed the centreline radius of "
                f"{case.centreline_radius / MILLIMETRE:g} mm, "
                f"got {self.guide_distance / MILLIMETRE:g} mm"
            )
        return free_length_of(self.guide_distance, case.centreline_radius)

    def _tension_law(self) -> DeadWeight | RigTension:
        # The law's own reference is the paper's: b (D / D0 - 1) is also linear in D over that one.
        scale = REFERENCE_DIAMETER / self.tension_reference_diameter
        law = RigTension(
            offset=self.tension_offset + self.tension_diameter_gain * (scale - 1.0),
            weight_share=self.tension_share,
            diameter_gain=self.tension_diameter_gain * scale,
            start_share=self.tension_start_share,
            build_up_length=self.tension_build_up,
        )
        return DeadWeight() if law.is_dead_weight else law

    def as_typed(self, typed: Mapping[str, object]) -> dict[str, Any]:
        """Return every option with nothing left open; what was typed stays as it was typed.

        Case 0 stands for no case typed.
        """
        what = self.resolved()
        case = what.case
        found: dict[str, Value] = dataclasses.asdict(self)
        found |= {
            "case": 0,
            "cylinder_diameter": case.cylinder_diameter,
            "cable_diameter": case.cable_diameter,
            "weight": case.weight,
            "nominal_stress": case.nominal_stress,
            "marker_spacing": case.marker_spacing,
            "free_length": what.free_length,
            "guide_distance": guide_distance_of(what.free_length, case.centreline_radius),
        }
        return {**shown_values(type(self), found), **typed}


def _spelled(configuration: type, spelling: Spelling | None) -> dict[str, str]:
    """Return how a refusal writes each field's name."""
    return {
        item.name: item.name if spelling is None else spelling(key)
        for key, item in options(configuration).items()
    }


def _undefined(spelled: Mapping[str, str]) -> str:
    return (
        f"say what to wind: {spelled['case']} 1 to {len(published_conditions())}, or "
        f"{spelled['cylinder_diameter']}, {spelled['cable_diameter']} and {spelled['weight']} "
        f"or {spelled['nominal_stress']}"
    )
