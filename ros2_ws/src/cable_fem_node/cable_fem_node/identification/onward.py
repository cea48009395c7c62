"""The rest of a run with the material that its first markers told."""

from __future__ import annotations

import copy
from collections.abc import Callable

import numpy as np

from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.run_history import Inputs, planned_inputs, replay
from winding_core.drive import DriveProfile
from winding_core.markers import Markers
from winding_core.run_inputs import INPUT_DTYPE


def planned_rest(inputs: Inputs, drive: DriveProfile, duration: float) -> Inputs:
    """Return the inputs that a plan has left, beginning where the machine stands now.

    The plan is entered where it has the cylinder's angle, so a run that was stopped for a while
    goes on. The tension stays the mean of the last second.

    Args:
        inputs: Of the run so far, shape (n,), n >= 1.
        drive: The plan.
        duration: Planned time of the whole run [s].
    """
    last = inputs[-1]
    angle, carriage = float(last["cylinder_angle"]), float(last["carriage_position"])
    entered = drive.time_at_angle(max(angle, 0.0))
    if entered >= duration:
        return np.zeros(0, dtype=INPUT_DTYPE)
    plan = planned_inputs(drive, duration)
    rest: Inputs = plan[plan["t"] > entered + 1.0e-6]
    _, planned_carriage = drive.positions(entered)
    rest["t"] += float(last["t"]) - entered
    rest["carriage_position"] += carriage - planned_carriage
    rest["tension"] = inputs["tension"][inputs["t"] >= last["t"] - 1.0].mean()
    return rest


def final_markers(
    model: RodWinding, rest: Inputs, going: Callable[[], bool] = lambda: True
) -> Markers:
    """Return the marker records at the end of a run; the model itself stays where it is.

    Args:
        model: Stands where the run is now.
        rest: Inputs from there on.
        going: Asked before every step whether the result is still wanted.

    Raises:
        AbandonedError: `going` said no.
    """
    ahead = copy.deepcopy(model)
    replay(rest, ahead, going)
    return ahead.markers()
