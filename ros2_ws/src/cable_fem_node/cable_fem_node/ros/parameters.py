"""Parameters of the solver's node."""

from __future__ import annotations

from dataclasses import dataclass

from cable_fem_node.winding.prediction import PlannedRun
from cable_fem_node.winding.winding_config import SolverParameters, WindingConfig
from winding_core.cable.condition import Condition
from winding_core.machine.axes import MachineAxes
from winding_core.parameters import parameter
from winding_core.run_inputs import ReplayParameters


@dataclass(frozen=True, kw_only=True)
class FemParameters(SolverParameters, ReplayParameters, MachineAxes, Condition):
    """What is wound, how the rod model discretises it, and what it follows."""

    follow_tension: bool = parameter(
        True, "whether the span tension follows rig/tension instead of the dead weight"
    )
    update_material: bool = parameter(
        True, "whether the effective modulus is identified from tracked markers"
    )
    take_up_material: bool = parameter(
        False, "whether the model and the prediction of the run go on with the identified modulus"
    )

    def winding_config(self) -> WindingConfig:
        """Return the model that the parameters describe.

        Raises:
            ValueError: The condition is not one, or the material cannot carry the weight.
        """
        return self.config_of(self.resolved())

    def planned(self) -> PlannedRun:
        """Return the run that the parameters describe.

        Raises:
            ValueError: As `winding_config`, or the solver cannot be right about the run.
        """
        return PlannedRun(
            config=self.winding_config(), drive=self.resolved().drive, duration=self.duration
        )
