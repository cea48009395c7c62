"""The cable's material identified from the tracked markers of a run."""

import math
from dataclasses import dataclass

from winding_core.status import Level, Status

NAME = "cable_fem: material"


@dataclass(frozen=True, kw_only=True)
class MaterialReport:
    """Material of a run's cable, as its markers determine it."""

    law: str  # Material law that was fitted
    young: float  # Effective Young's modulus [Pa]; nan where there is none
    standard_error: float  # [Pa]
    half_width_90: float  # The modulus lies within this nine times in ten [Pa]
    markers: tuple[int, ...]  # Numbers of the markers used
    worst_share: float  # Greatest miss of an angle, relative to the angle
    taken_up: bool  # Whether model and prediction go on with it
    refusal: str = ""  # Why it must not be used; empty where it may be

    def status(self) -> Status:
        """Return the report as a component's state."""
        return Status(
            name=NAME,
            level=Level.WARN if self.refusal else Level.OK,
            message=self.refusal or self._message(),
            values={
                "law": self.law,
                "young": repr(self.young),
                "standard_error": repr(self.standard_error),
                "half_width_90": repr(self.half_width_90),
                "markers": " ".join(map(str, self.markers)),
                "worst_share": repr(self.worst_share),
                "taken_up": "yes" if self.taken_up else "no",
            },
        )

    def _message(self) -> str:
        numbers = ", ".join(f"P{marker}" for marker in self.markers)
        return (
            f"effective modulus {self.young / 1e6:.3f} MPa, nine times in ten within "
            f"{self.half_width_90 / 1e6:.3f} MPa, from {numbers}"
        )


def refused_material(law: str, markers: tuple[int, ...], refusal: str) -> MaterialReport:
    """Return the report of an identification that found nothing."""
    return MaterialReport(
        law=law,
        young=math.nan,
        standard_error=math.nan,
        half_width_90=math.nan,
        markers=markers,
        worst_share=math.nan,
        taken_up=False,
        refusal=refusal,
    )
