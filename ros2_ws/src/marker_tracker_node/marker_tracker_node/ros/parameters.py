"""Parameters of the tracker's node."""

from dataclasses import dataclass

from winding_core.cable.condition import Condition
from winding_core.machine.axes import MachineAxes
from winding_core.markers import MarkerParameters
from winding_core.run_inputs import ReplayParameters
from winding_core.run_options import (
    CameraClockParameters,
    CameraPixels,
    CameraPlacement,
    LayParameters,
)


@dataclass(frozen=True, kw_only=True)
class TrackerParameters(
    LayParameters,
    MarkerParameters,
    CameraPixels,
    CameraClockParameters,
    CameraPlacement,
    ReplayParameters,
    MachineAxes,
    Condition,
):
    """What is wound, what of it the camera sees from where, and what is done about its clock."""
