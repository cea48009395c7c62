"""A condition of one's own as an operator types it: millimetres and newton, with limits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from winding_core.condition import Condition
from winding_core.parameters import build
from winding_core.units import MILLIMETRE


@dataclass(frozen=True, kw_only=True)
class OwnValue:
    """One value of the form.

    Attributes:
        name: Of the parameter.
        label: What the operator reads.
        unit: Of what is typed.
        scale: One such unit [SI].
        low: Least that is taken, in that unit.
        high: Most.
    """

    name: str
    label: str
    unit: str
    scale: float
    low: float
    high: float

    def refusal(self, typed: object) -> str:
        """Return why something typed is not taken; empty when it is."""
        limits = f"{self.low:g} to {self.high:g} {self.unit}"
        if typed is None or typed == "":
            return f"{self.label.lower()} is missing; it must be {limits}"
        if not isinstance(typed, int | float) or not math.isfinite(typed):
            return f"{self.label.lower()} must be a number from {limits}, got {typed}"
        if not self.low <= typed <= self.high:
            return f"{self.label.lower()} must be {limits}, got {typed:g} {self.unit}"
        return ""


# Wide enough for every laboratory winder, narrow enough for metres typed as millimetres.
OWN_VALUES = (
    OwnValue(
        name="cylinder_diameter",
        label="Cylinder diameter",
        unit="mm",
        scale=MILLIMETRE,
        low=5.0,
        high=500.0,
    ),
    OwnValue(
        name="cable_diameter",
        label="Cable diameter",
        unit="mm",
        scale=MILLIMETRE,
        low=0.5,
        high=20.0,
    ),
    OwnValue(name="weight", label="Weight", unit="N", scale=1.0, low=0.05, high=100.0),
    OwnValue(
        name="marker_spacing",
        label="Marker spacing",
        unit="mm",
        scale=MILLIMETRE,
        low=10.0,
        high=1000.0,
    ),
)


def own_condition(typed: Mapping[str, object]) -> dict[str, float]:
    """Return the parameters [SI] that a filled form means.

    Args:
        typed: What stands in the form, by parameter name.

    Raises:
        ValueError: One sentence that names the value and its limits.
    """
    values = {}
    for item in OWN_VALUES:
        said = typed.get(item.name)
        if refusal := item.refusal(said):
            raise ValueError(refusal)
        assert isinstance(said, int | float)
        values[item.name] = float(said) * item.scale
    build(Condition, {"case": 0, **values}, owner="the next run").resolved()
    return values


def condition_parameters(case: int, own: Mapping[str, float]) -> dict[str, object]:
    """Return what every node is told of a condition; values of another one are taken back."""
    blank = {item.name: 0.0 for item in OWN_VALUES}
    return {"case": case, **blank, **(own if case == 0 else {})}
