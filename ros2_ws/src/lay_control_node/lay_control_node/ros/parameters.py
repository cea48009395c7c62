"""Parameters of the lay controller's node."""

from dataclasses import dataclass
from pathlib import Path

from lay_control_node.control.control_parameters import ControlParameters
from lay_control_node.control.guide_law import WantedProgram
from lay_control_node.control.lay_controller import LayController
from lay_control_node.programs.points import FULL_TURN
from lay_control_node.programs.reading import read_program
from lay_control_node.programs.simple_programs import even_helix, with_markers_every_turn
from winding_core.cable.condition import Condition, ResolvedCondition
from winding_core.lay.drum_parameters import DrumParameters
from winding_core.lay.layers import WoundDrum
from winding_core.lay.program import LayProgram, LayProgramError
from winding_core.lay.records import ControlMode
from winding_core.machine.axes import MachineAxes
from winding_core.parameters import parameter
from winding_core.run_options import LayWish

# Turns that an even helix goes on beyond what the drive winds in the condition's time.
_BEYOND = 2.0


@dataclass(frozen=True, kw_only=True)
class LayControlParameters(ControlParameters, LayWish, DrumParameters, MachineAxes, Condition):
    """What is wound, what is wanted of the lay, and how it is brought about."""

    solver_patience: float = parameter(
        1.0,
        "time without the solver after which the guide follows the drive programme [s]",
        low=0.1,
        high=60.0,
    )

    def wanted(self, what: ResolvedCondition) -> LayProgram:
        """Return the lay that is wanted.

        Raises:
            LayProgramError: The program cannot be read or used.
        """
        wound = self.filling(what)
        if wound is not None:
            return wound.program()
        if self.program and self.pitch:
            raise LayProgramError("give program or pitch, not both")
        if self.program:
            program = read_program(Path(self.program), radius=what.case.centreline_radius)
        else:
            turns = what.drive.positions(what.duration)[0] / FULL_TURN + _BEYOND
            program = even_helix(self.pitch or what.drive.pitch, turns)
        if self.markers_every_turn:
            program = with_markers_every_turn(program, what.case.marker_count)
        if program.markers and not self.brake:
            raise LayProgramError(
                "the program states where markers shall land, which needs a brake"
            )
        return program

    def filling(self, what: ResolvedCondition) -> WoundDrum | None:
        """Return the drum as it is to be filled; None where that is not configured."""
        return self.wind(what.case, self.pitch or None) if self.filled else None

    def new_controller(self) -> LayController:
        """Return the controller of a run.

        Raises:
            ValueError: The condition, the limits or the program cannot be used.
        """
        what = self.resolved()
        program = self.wanted(what)
        return self.controller(
            what,
            WantedProgram.of(program, what, self.limits(what)),
            markers=program.markers if self.brake else {},
            mode=ControlMode[self.control.upper()],
            solver_patience=self.solver_patience,
            wound=self.filling(what),
            brake=self.brake,
        )
