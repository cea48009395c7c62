"""Parameters of the solver's node."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from cable_fem_node.winding.prediction import PlannedRun
from cable_fem_node.winding.winding_config import SolverParameters, WindingConfig
from winding_core.cable.condition import Condition, ResolvedCondition
from winding_core.lay.drum_parameters import DrumParameters
from winding_core.lay.guide_path import lay_of_drive
from winding_core.lay.limits import GuideBounds
from winding_core.lay.rounding import GuidedDrive
from winding_core.machine.axes import MachineAxes
from winding_core.machine.drive import DriveProfile
from winding_core.machine.drum import DrumError
from winding_core.parameters import parameter
from winding_core.run_inputs import ReplayParameters
from winding_core.units import LENGTH


@dataclass(frozen=True, kw_only=True)
class FemParameters(
    SolverParameters, ReplayParameters, GuideBounds, DrumParameters, MachineAxes, Condition
):
    """What is wound, how the solver winds it, and what it follows."""

    pitch: float = parameter(
        0.0,
        "pitch of a drum that is filled",
        LENGTH,
        -1.0,
        1.0,
        otherwise="the grooves', or the cable's diameter",
    )
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
            drive=self._drive(what),
            duration=what.duration,
            element=self.element,
        )

    def ahead(self) -> PlannedRun:
        """Return the run as it is wound ahead, with the rod.

        Where another lay is wanted of a controlled run, the drive programme may leave the drum: it
        is then predicted on a bare cylinder.
        """
        run, what = self.of_rod().in_step(), self.resolved()
        if run.config.drum is not None and not self.filled:
            try:
                run.config.drum.refuse_beyond(*lay_of_drive(what), what.case.cable_diameter)
            except DrumError:
                return dataclasses.replace(run, config=dataclasses.replace(run.config, drum=None))
        return run

    def config_of(self, what: ResolvedCondition) -> WindingConfig:
        """See `SolverParameters.config_of`; between the flanges of the drum if there is one."""
        found, drum = super().config_of(what), self.drum(what.case)
        return found if drum is None else dataclasses.replace(found, drum=drum)

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

    def _drive(self, what: ResolvedCondition) -> DriveProfile:
        if not self.filled:
            return what.drive
        program = self.wind(what.case, self.pitch or None).program()
        return GuidedDrive.along(program, what, self.limits(what))
