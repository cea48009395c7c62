"""Parameters of the tracker's node."""

from __future__ import annotations

from dataclasses import dataclass

from winding_core.camera_placement import CameraPlacement
from winding_core.condition import Condition
from winding_core.machine_axes import MachineAxes
from winding_core.parameters import parameter


@dataclass(frozen=True, kw_only=True)
class TrackerParameters(CameraPlacement, MachineAxes, Condition):
    """What is wound, and where the camera stands."""

    band_width: float = parameter(
        0.006, "width of a marker band along the cable [m]", low=0.0005, high=0.05
    )
    camera_clock_correction: bool = parameter(
        False, "whether the measured offset of the camera's clock is applied to later frames"
    )
    camera_clock_limit: float = parameter(
        0.25,
        "largest offset of the camera's clock with which frames are used [s]",
        low=0.001,
        high=2.0,
    )
