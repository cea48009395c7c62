"""Parameters of the tracker's node."""

from __future__ import annotations

from dataclasses import dataclass

from winding_core.camera_clock import CameraClockParameters
from winding_core.camera_pixels import CameraPixels
from winding_core.camera_placement import CameraPlacement
from winding_core.condition import Condition
from winding_core.lay_parameters import LayParameters
from winding_core.machine_axes import MachineAxes
from winding_core.marker_parameters import MarkerParameters
from winding_core.run_inputs import ReplayParameters


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
