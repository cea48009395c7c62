"""A lay program as the controller follows it: rounded as much as carriage and friction need."""

from __future__ import annotations

from dataclasses import dataclass, replace

from lay_control_node.control.guide_law import WantedPoint
from lay_control_node.planning.guide_path import guide_path, within
from lay_control_node.planning.kernel_width import needed_width, width_without_slip
from lay_control_node.planning.limits import PlanLimits
from lay_control_node.planning.smoothed_line import SmoothedLine, smoothed_program
from winding_core.cable.condition import ResolvedCondition
from winding_core.lay.program import LayProgram


@dataclass(frozen=True, kw_only=True)
class WantedProgram:
    """A program's rounded line; before P0 and after its end the helices go on."""

    line: SmoothedLine

    @classmethod
    def of(cls, program: LayProgram, what: ResolvedCondition, limits: PlanLimits) -> WantedProgram:
        """Return a program, rounded for a condition's speed and friction and a machine's limits."""
        lag = what.free_length / what.case.centreline_radius
        path = within(guide_path(program, lag, 0.0), *limits.travel)
        width = needed_width(path, what.drive.angular_speed, limits)
        line = smoothed_program(program, width)
        held = width_without_slip(line, what.case.centreline_radius, what.friction)
        return cls(line=replace(line, width=max(width, held)))

    def at(self, theta: float) -> WantedPoint:
        """Return what is wanted at a wound angle [rad]."""
        z, slope, curvature = (float(self.line.at(theta, order)) for order in range(3))
        return WantedPoint(z=z, slope=slope, curvature=curvature)
