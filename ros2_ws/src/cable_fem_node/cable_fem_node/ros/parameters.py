"""Parameters of the solver's node."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from cable_fem_node.winding.prediction import PlannedRun
from cable_fem_node.winding.winding_config import SolverParameters, WindingConfig
from winding_core.cable.condition import Condition
from winding_core.machine.axes import MachineAxes
from winding_core.parameters import parameter
from winding_core.run_inputs import ReplayParameters


@dataclass(frozen=True, kw_only=True)
class FemParameters(SolverParameters, ReplayParameters, MachineAxes, Condition):
    """What is wound, how the solver winds it, and what it follows."""

    follow_tension: bool = parameter(
        True, "whether the span tension follows rig/tension instead of the dead weight"
    )
    update_material: bool = parameter(
        True, "whether the effective modulus is identified from tracked markers"
    )
    take_up_material: bool = parameter(
        False, "whether the model and the prediction of the run go on with the identified modulus"
    )

    def in_step(self) -> PlannedRun:
        """Return the run with the element that follows the machine.

        Raises:
            ValueError: The condition is not one, or the element cannot wind it as wanted.
        """
        if self.element != "rod" and self.take_up_material:
            raise ValueError(
                "take_up_material goes on with a rod of the identified modulus: leave it out, or "
                f"take element rod instead of {self.element}"
            )
        what = self.resolved()
        return PlannedRun(
            config=self.config_of(what),
            drive=what.drive,
            duration=what.duration,
            element=self.element,
        )

    def of_rod(self) -> FemParameters:
        """Return the parameters of the rod beside another element: mesh and mass are its own."""
        if self.element == "rod":
            return self
        return dataclasses.replace(self, element="rod", segment_length=0.0, mass_scaling=0.0)

    def winding_config(self) -> WindingConfig:
        """Return the rod's model, by which runs are predicted ahead and materials identified.

        Raises:
            ValueError: The condition is not one, or the material cannot carry the weight.
        """
        return self.of_rod().config_of(self.resolved())
