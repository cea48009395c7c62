"""Parameters of the tracker's node."""

from __future__ import annotations

from dataclasses import dataclass

from winding_core.camera_clock import CameraClockParameters
from winding_core.camera_placement import CameraPlacement
from winding_core.condition import Condition
from winding_core.machine_axes import MachineAxes
from winding_core.parameters import parameter


@dataclass(frozen=True, kw_only=True)
class TrackerParameters(CameraClockParameters, CameraPlacement, MachineAxes, Condition):
    """What is wound, where the camera stands, and what is done about its clock."""

    band_width: float = parameter(
        0.006, "width of a marker band along the cable [m]", low=0.0005, high=0.05
    )
