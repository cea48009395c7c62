"""What is wound, in one line: the values that diagnostics carry, and a sentence to read."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

from winding_core.cable.condition import ResolvedCondition
from winding_core.machine.drum import Drum
from winding_core.units import MILLIMETRE


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
        try:
            flanges = None
            if "flange_radius [m]" in values:
                flanges = Flanges(
                    low=float(values["flange_low [m]"]),
                    high=float(values["flange_high [m]"]),
                    radius=float(values["flange_radius [m]"]),
                )
            return cls(
                case=int(values["case"]),
                cylinder_diameter=float(values["cylinder_diameter [m]"]),
                cable_diameter=float(values["cable_diameter [m]"]),
                weight=float(values["weight [N]"]),
                duration=float(values["duration [s]"]),
                ramp_time=float(values.get("ramp_time [s]", 0.0)),
                flanges=flanges,
            )
        except (KeyError, ValueError):
            return None

    def values(self) -> dict[str, str]:
        """Return the label as values of a status."""
        found = {
            "case": str(self.case),
            "cylinder_diameter [m]": f"{self.cylinder_diameter:.6g}",
            "cable_diameter [m]": f"{self.cable_diameter:.6g}",
            "weight [N]": f"{self.weight:.6g}",
            "duration [s]": f"{self.duration:.6g}",
            "ramp_time [s]": f"{self.ramp_time:.6g}",
        }
        if self.flanges is not None:
            found |= {
                "flange_low [m]": f"{self.flanges.low:.6g}",
                "flange_high [m]": f"{self.flanges.high:.6g}",
                "flange_radius [m]": f"{self.flanges.radius:.6g}",
            }
        return found

    @property
    def sentence(self) -> str:
        """The measures in words."""
        return (
            f"cylinder {self.cylinder_diameter / MILLIMETRE:g} mm, "
            f"cable {self.cable_diameter / MILLIMETRE:g} mm, {self.weight:.2f} N"
        )
