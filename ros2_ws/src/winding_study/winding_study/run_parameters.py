"""What a run of the solver winds, and with what: the options of commands and sweeps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from cable_fem_node.winding.prediction import ELEMENTS, PlannedRun
from cable_fem_node.winding.winding_config import SolverParameters
from winding_core.cable.condition import Condition
from winding_core.machine.drive import DriveProfile, TurningDrive
from winding_core.parameters import parameter
from winding_core.units import LENGTH, PLAIN, TIME

# The factor on the density: a solid's steps are so short that its true mass takes hours.
_MASS_SCALING = {"rod": 1.0, "solid": 400.0}


@dataclass(frozen=True, kw_only=True)
class RunParameters(SolverParameters, Condition):
    """A condition, the solver's mesh and its element, and how a plan turns back."""

    element: str = parameter("rod", "element", choices=ELEMENTS, unit=PLAIN)
    guide_turns_at: float = parameter(
        0.0,
        "carriage position at which the guide turns back",
        LENGTH,
        -100.0,
        100.0,
        otherwise="it never does",
    )
    unwind_from: float = parameter(
        0.0,
        "time from which both axes go back the way they came",
        TIME,
        0.05,
        3.6e3,
        otherwise="the cable stays wound",
    )

    def plan(self) -> PlannedRun:
        """Return the run.

        Raises:
            ValueError: The condition is incomplete or leaves the range of the model.
        """
        what = self.resolved()
        return PlannedRun(
            config=self.config_of(what, mass_scaling=_MASS_SCALING[self.element]),
            drive=self._turning(what.drive),
            duration=what.duration,
            element=self.element,
        )

    def _turning(self, drive: DriveProfile) -> DriveProfile:
        if not (self.guide_turns_at or self.unwind_from):
            return drive
        return TurningDrive(
            angular_speed=drive.angular_speed,
            feed_speed=drive.feed_speed,
            ramp_time=drive.ramp_time,
            guide_turns_at=self.guide_turns_at or None,
            unwinds_from=self.unwind_from or None,
        )

    def as_typed(self, typed: Mapping[str, object]) -> dict[str, Any]:
        """Return every option with nothing left open; what was typed stays as it was typed."""
        scaling = self.mass_scaling or _MASS_SCALING[self.element]
        return {**super().as_typed({}), "mass_scaling": scaling, **typed}
