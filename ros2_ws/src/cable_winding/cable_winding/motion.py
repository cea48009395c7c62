"""Plan the machine's motion that lays a cable where it is wanted."""

import math
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lay_control_node.planning.planner import plan_lay
from lay_control_node.programs import even_helix, read_program, with_markers_every_turn
from winding_core.cable.condition import Condition
from winding_study.plans.drum_plan import DrumPlanParameters, PlanParameters

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class MotionPlan:
    """Setpoints of both axes and the brake, and the lay that follows from them.

    Attributes:
        t: Times of the setpoints [s], shape (m,).
        cylinder: Angle of the cylinder [rad], shape (m,).
        guide: Position of the guide [m], shape (m,).
        tension: Pull of the brake [N], shape (m,).
        theta: Wound angles of the lay [rad], shape (n,).
        z: Predicted axial position there [m], shape (n,).
        z_wanted: Wanted axial position there [m], shape (n,).
        landings: Predicted wound angle of marker k [rad], by k; NaN where it does not land.
        radius: Of the lay's centre line there [m], shape (n,); that of its layer on a drum.
        warnings: What of the program is out of reach, one sentence each.
    """

    t: FloatArray
    cylinder: FloatArray
    guide: FloatArray
    tension: FloatArray
    theta: FloatArray
    z: FloatArray
    z_wanted: FloatArray
    radius: FloatArray
    landings: dict[int, float]
    warnings: tuple[str, ...]

    @property
    def residual(self) -> FloatArray:
        """Predicted less wanted axial position [m], shape (n,)."""
        return self.z - self.z_wanted


def plan(
    condition: Condition,
    program: str | PathLike[str] | None = None,
    *,
    pitch: float | None = None,
    turns: float | None = None,
    markers_every_turn: bool = False,
    tolerance: float | None = None,
    period: float = 0.01,
    limits: PlanParameters | None = None,
    drum: DrumPlanParameters | None = None,
) -> MotionPlan:
    """Plan guide, cylinder and brake for a lay program, as `winding plan` does.

    Args:
        condition: What is wound, and how fast at most.
        program: File of the lay program (.yaml, .csv or .gcode); None for an even helix.
        pitch: Axial advance per turn of the helix [m], or between turns on a drum that is filled;
            None for the condition's drive, or the drum's grooves or the cable's diameter.
        turns: Count of turns of the helix; None for those of the condition's duration.
        markers_every_turn: Whether marker k shall land after k turns.
        tolerance: Distance by which a corner may be rounded [m]; the cylinder slows down for it.
        period: Time between setpoints [s].
        limits: Limits of the machine; None for the simulated machine's.
        drum: Flanges and grooves of the cylinder. With layers or a length it is filled, by a
            program of its own; else the program has to lie between its flanges.

    Returns:
        The setpoints and the predicted lay.

    Raises:
        ValueError: The program cannot be read, overlaps itself, or leaves the drum or the machine's
            limits.
    """
    what = condition.resolved()
    bounds = (limits or PlanParameters()).limits()
    if drum is not None and drum.filled:
        if program is not None or turns is not None or markers_every_turn:
            raise ValueError(
                "a drum has a program of its own: leave out program, turns and markers_every_turn"
            )
        what = drum.paced(what)
        wound = drum.wind(what.case, pitch)
        wanted = drum.program(wound, what, bounds)
    elif program is not None:
        if pitch is not None or turns is not None:
            raise ValueError("pitch and turns define an even helix: leave them out with a program")
        wanted = read_program(Path(program), radius=what.case.centreline_radius)
    else:
        if turns is None:
            turns = float(what.drive.positions(what.duration)[0]) / math.tau
        wanted = even_helix(what.drive.pitch if pitch is None else pitch, turns)
    if markers_every_turn:
        wanted = with_markers_every_turn(wanted, what.case.marker_count)
    between = None if drum is None else drum.drum(what.case)
    if between is not None:
        between.refuse_beyond(wanted.theta, wanted.z, what.case.cable_diameter)
    even_cable = drum is not None and drum.filled
    found = plan_lay(wanted, what, bounds, residual_limit=tolerance, even_cable=even_cable)
    setpoints = found.samples(found.times(period))
    return MotionPlan(
        t=setpoints.t,
        cylinder=setpoints.cylinder,
        guide=setpoints.guide,
        tension=setpoints.commanded,
        theta=found.theta,
        z=found.predicted,
        z_wanted=np.asarray(wanted.z_at(found.theta)),
        radius=found.radius + wanted.raised_at(found.theta),
        landings={landing.number: landing.predicted for landing in found.landings},
        warnings=found.sentences,
    )
