"""What is wound: cable, cylinder, weight and markers as parameters."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from winding_core.cases import Case, Material, paper_case
from winding_core.material_law import LawParameters
from winding_core.parameters import ParameterError, parameter
from winding_core.prony import PronySeries
from winding_core.published import published_conditions
from winding_core.units import DENSITY, FORCE, LENGTH, MILLIMETRE, PLAIN, STRESS

# The paper's markers are spaced like this on most cables [m].
OWN_MARKER_SPACING = 0.1
_CASE_VALUE = "the case's"


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
        0.0, "undeformed cable diameter", LENGTH, 1.0e-4, 0.1, otherwise=_CASE_VALUE
    )
    weight: float = parameter(
        0.0,
        "dead weight on the cable's end",
        FORCE,
        1.0e-3,
        1.0e3,
        option="tension",
        otherwise=_CASE_VALUE,
    )
    nominal_stress: float = parameter(
        0.0,
        "dead weight over the undeformed section, instead of the weight",
        STRESS,
        1.0e2,
        1.0e9,
        option="tension",
        otherwise="the weight",
    )
    marker_spacing: float = parameter(
        0.0,
        "marker spacing along the undeformed cable",
        LENGTH,
        1.0e-3,
        10.0,
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
        Material.bending_factor, "factor on the bending stiffness EI", PLAIN, 1.0e-3, 1.0e3
    )
    prony: str = parameter(
        "",
        "how the stress of the stretched cable fades: terms share:seconds joined by +, as "
        "0.2:1.5+0.1:30, with the modulus at once as Young's; empty for an elastic cable",
        PLAIN,
        label="Relaxation share:seconds",
    )


@dataclass(frozen=True, kw_only=True)
class CableParameters(LawParameters, CableAndLoad):
    """What is wound, its material law, and how it rubs."""

    friction: float = parameter(
        0.1, "Coulomb friction of cable on cylinder, dimensionless", PLAIN, 0.0, 2.0
    )

    def wound_case(self, spelled: Mapping[str, str]) -> Case:
        """Return the case that the parameters name or spell out.

        Args:
            spelled: How a refusal writes each parameter's name.

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

    Args:
        number: Of the case, as it was given.
        name: How a refusal writes what was given.

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
