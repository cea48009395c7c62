"""Parameters of the tracker's node."""

from __future__ import annotations

from dataclasses import dataclass

from winding_core.condition import Condition
from winding_core.machine_axes import MachineAxes
from winding_core.parameters import parameter


@dataclass(frozen=True, kw_only=True)
class TrackerParameters(MachineAxes, Condition):
    """What is wound, and where the camera stands."""

    band_width: float = parameter(
        0.006, "width of a marker band along the cable [m]", low=0.0005, high=0.05
    )
    camera_position: list[float] = parameter(
        [0.4175, 0.0, 0.05], "camera position in winder_axis [m]", low=-10.0, high=10.0
    )
    camera_tilt: list[float] = parameter(
        [0.0, 0.0, 0.0],
        "rotation of the camera from facing -x, image right +z, image down +y [rad]",
        low=-0.5,
        high=0.5,
    )
