"""The drum as options: its flanges and grooves, and how it is filled between them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from winding_core.cable.cases import Case
from winding_core.lay.drum_winding import DrumWinding
from winding_core.lay.layers import WINDINGS, WoundDrum
from winding_core.machine.drum import START_SIDES, Drum
from winding_core.parameters import ParameterError, Spelling, parameter, typed_values
from winding_core.units import LENGTH, LONG_LENGTH, PLAIN, TURNS


@dataclass(frozen=True, kw_only=True)
class DrumShape:
    """Flanges and grooves of the cylinder."""

    drum_width: float = parameter(
        0.0, "width between the flanges", LENGTH, 1.0e-3, 10.0, otherwise="no drum"
    )
    flange: float = parameter(
        0.0, "height of the flanges over the cylinder", LENGTH, 1.0e-4, 5.0, otherwise="none"
    )
    groove_pitch: float = parameter(
        0.0, "pitch of the drum's grooves", LENGTH, 1.0e-4, 0.2, otherwise="a smooth drum"
    )
    start_side: str = parameter(
        "low", "flange at which P0 lies, by its z", PLAIN, choices=tuple(START_SIDES)
    )

    def drum(self, case: Case) -> Drum | None:
        """Return a case's cylinder as a drum; None for one without flanges.

        Raises:
            ParameterError: A width or a height of the flanges is given without the other.
        """
        if not (self.drum_width or self.flange):
            return None
        for name in ("drum_width", "flange"):
            if not getattr(self, name):
                raise ParameterError(f"a drum needs drum_width and flange, {name} is missing")
        return Drum(
            radius=case.cylinder_radius,
            width=self.drum_width,
            flange_height=self.flange,
            groove_pitch=self.groove_pitch or None,
            start_side=self.start_side,
        )


@dataclass(frozen=True, kw_only=True)
class DrumParameters(DrumShape):
    """Flanges and grooves of the cylinder, and how it is filled between them."""

    winding: str = parameter("orthocyclic", "how turns and layers lie", PLAIN, choices=WINDINGS)
    layers: int = parameter(0, "how many layers", PLAIN, 1, 10_000, otherwise="those of the length")
    length: float = parameter(
        0.0,
        "length of cable on the drum",
        LONG_LENGTH,
        1.0e-3,
        1.0e5,
        otherwise="that of the layers",
    )
    crossing_share: float = parameter(
        DrumWinding.crossing_share,
        "share of a turn in which an orthocyclic one crosses to its next place",
        PLAIN,
        0.01,
        0.99,
    )
    edge_dwell: float = parameter(
        DrumWinding.edge_dwell,
        "for how long a parallel or cross winding rests at a flange while it climbs",
        TURNS,
        0.0,
        2.0 * math.pi,
    )

    @classmethod
    def from_options(cls, typed: Mapping[str, object], *, spelling: Spelling = str) -> Self:
        """Return the drum that typed options mean.

        Args:
            typed: By option, in the unit of its name.
            spelling: How a refusal writes an option's name.

        Raises:
            ParameterError: A value is refused, or has no meaning beside the others.
        """
        values: dict[str, Any] = typed_values(cls, typed, spelling)
        found = cls(**values)
        if not typed:
            return found
        width, flange = spelling("drum_width_mm"), spelling("flange_mm")
        for value, name in ((found.drum_width, width), (found.flange, flange)):
            if not value:
                raise ParameterError(f"a drum needs {width} and {flange}, {name} is missing")
        useless = "edge_dwell_turns" if found.winding == "orthocyclic" else "crossing_share"
        if useless in typed:
            raise ParameterError(f"{found.winding} winding has no {spelling(useless)}")
        return found

    @property
    def filled(self) -> bool:
        """Whether it is said how much cable goes on the drum."""
        return bool(self.layers or self.length)

    def wind(self, case: Case, pitch: float | None) -> WoundDrum:
        """Return a case's cylinder as a drum with its cable on it.

        Args:
            case: What is wound.
            pitch: Between turns [m]; None for that of the grooves, or else the cable's diameter.

        Raises:
            ParameterError: There is no drum.
            DrumError: The cable would leave the drum, or it is not said how much goes on it.
        """
        drum = self.drum(case)
        if drum is None:
            raise ParameterError("cable is wound in layers between the flanges of a drum")
        how = DrumWinding(
            winding=self.winding,
            pitch=pitch,
            crossing_share=self.crossing_share,
            edge_dwell=self.edge_dwell,
        )
        return how.wind(
            drum, case.cable_diameter, layers=self.layers or None, length=self.length or None
        )
