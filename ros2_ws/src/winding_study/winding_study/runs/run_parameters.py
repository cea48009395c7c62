"""What a run of the solver winds, and with what: the options of commands and sweeps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from cable_fem_node.winding.prediction import ELEMENTS, PlannedRun
from cable_fem_node.winding.winding_config import SolverParameters
from winding_core.condition import Condition
from winding_core.parameters import parameter
from winding_core.units import PLAIN

# The factor on the density: a solid's steps are so short that its true mass takes hours.
_MASS_SCALING = {"rod": 1.0, "solid": 400.0}


@dataclass(frozen=True, kw_only=True)
class RunParameters(SolverParameters, Condition):
    """A condition, the solver's mesh and its element."""

    element: str = parameter("rod", "element", choices=ELEMENTS, unit=PLAIN)

    def plan(self) -> PlannedRun:
        """Return the run.

        Raises:
            ValueError: The condition is incomplete or leaves the range of the model.
        """
        what = self.resolved()
        return PlannedRun(
            config=self.config_of(what, mass_scaling=_MASS_SCALING[self.element]),
            drive=what.drive,
            duration=what.duration,
            element=self.element,
        )

    def as_typed(self, typed: Mapping[str, object]) -> dict[str, Any]:
        """Return every option with nothing left open; what was typed stays as it was typed."""
        scaling = self.mass_scaling or _MASS_SCALING[self.element]
        return {**super().as_typed({}), "mass_scaling": scaling, **typed}
