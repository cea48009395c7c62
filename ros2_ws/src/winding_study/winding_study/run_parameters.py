"""What a run of the solver winds, and with what: the options of commands and sweeps."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from cable_fem_node.winding.prediction import PlannedRun
from cable_fem_node.winding.winding_config import SolverParameters
from winding_core.cable.condition import Condition
from winding_core.machine.drive import DriveProfile, TurningDrive
from winding_core.parameters import parameter
from winding_core.units import LENGTH, TIME


@dataclass(frozen=True, kw_only=True)
class RunParameters(SolverParameters, Condition):
    """A condition, the solver's options, and how a plan turns back."""

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
            config=self.config_of(what),
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
        return {**super().as_typed({}), "mass_scaling": self.scaling, **typed}
