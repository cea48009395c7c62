"""Where the camera stands, stated once for the tracker, the operator's page and the URDF."""

from __future__ import annotations

from dataclasses import dataclass

from winding_core.parameters import parameter
from winding_core.units import LENGTH, SMALL_ANGLE


@dataclass(frozen=True, kw_only=True)
class CameraPlacement:
    """Extrinsics of the camera: nominally it faces -x, image right +z, image down +y."""

    camera_position: list[float] = parameter(
        [0.4175, 0.0, 0.05], "camera position in winder_axis", LENGTH, -10.0, 10.0
    )
    camera_tilt: list[float] = parameter(
        [0.0, 0.0, 0.0],
        "rotation of the camera from facing -x, image right +z, image down +y",
        SMALL_ANGLE,
        -0.5,
        0.5,
    )
