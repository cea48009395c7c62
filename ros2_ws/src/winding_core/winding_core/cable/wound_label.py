"""What is wound, in one line: the values that diagnostics carry, and a sentence to read."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

from winding_core.cable.condition import ResolvedCondition
from winding_core.machine.drum import Drum
from winding_core.units import MILLIMETRE

# Numbers that a status carries beside the case, with their units; and those of the flanges.
_NUMBERS = {
    "cylinder_diameter": "m", "cable_diameter": "m", "weight": "N", "duration": "s",
    "ramp_time": "s",
}  # fmt: skip
_OF_FLANGES = ("low", "high", "radius")


@dataclass(frozen=True, kw_only=True)
class Flanges:
    """The flanges that the cable lies between."""

    low: float  # Inner face of the one at the lower z, from P0's [m]
    high: float  # Inner face of the other [m]
    radius: float  # Of their edges [m]


@dataclass(frozen=True, kw_only=True)
class WoundLabel:
    """A condition's name, its measures and its length."""

    case: int  # Row of the paper's Table 1; 0 for any other condition.
    cylinder_diameter: float  # [m]
    cable_diameter: float  # [m]
    weight: float  # Pull on the cable [N].
    duration: float  # Of the run, on the machine's clock [s].
    ramp_time: float = 0.0  # Of both axes [s]; 0 where it is unknown, as in older recordings
    flanges: Flanges | None = None  # None for a cylinder without them

    @classmethod
    def of(cls, condition: ResolvedCondition, drum: Drum | None = None) -> Self:
        """Return the label of a condition, and of the drum that it is wound on."""
        case = condition.case
        flanges = None
        if drum is not None:
            low, high = drum.inner_faces(case.cable_diameter)
            flanges = Flanges(low=low, high=high, radius=drum.flange_radius)
        return cls(
            case=case.number,
            cylinder_diameter=case.cylinder_diameter,
            cable_diameter=case.cable_diameter,
            weight=case.weight,
            duration=condition.duration,
            ramp_time=condition.drive.ramp_time,
            flanges=flanges,
        )

    @classmethod
    def from_values(cls, values: Mapping[str, str]) -> Self | None:
        """Return the label that diagnostics carry; None where they carry none."""
        numbers: dict[str, float] = {}
        ends: dict[str, float] = {}
        try:
            for name, unit in _NUMBERS.items():
                # Older recordings have no ramp.
                if name != "ramp_time" or f"{name} [{unit}]" in values:
                    numbers[name] = float(values[f"{name} [{unit}]"])
            if "flange_radius [m]" in values:
                ends = {name: float(values[f"flange_{name} [m]"]) for name in _OF_FLANGES}
            return cls(
                case=int(values["case"]), flanges=Flanges(**ends) if ends else None, **numbers
            )
        except (KeyError, ValueError):
            return None

    def values(self) -> dict[str, str]:
        """Return the label as values of a status."""
        found = {"case": str(self.case)}
        found |= {
            f"{name} [{unit}]": f"{getattr(self, name):.6g}" for name, unit in _NUMBERS.items()
        }
        if self.flanges is not None:
            found |= {
                f"flange_{name} [m]": f"{getattr(self.flanges, name):.6g}" for name in _OF_FLANGES
            }
        return found

    @property
    def sentence(self) -> str:
        """The measures in words."""
        return (
            f"cylinder {self.cylinder_diameter / MILLIMETRE:g} mm, "
            f"cable {self.cable_diameter / MILLIMETRE:g} mm, {self.weight:.2f} N"
        )
