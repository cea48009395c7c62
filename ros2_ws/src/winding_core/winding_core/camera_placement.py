"""Where the camera stands, stated once for the tracker, the operator's page and the URDF."""

from __future__ import annotations

from dataclasses import dataclass

from winding_core.parameters import parameter


@dataclass(frozen=True, kw_only=True)
class CameraPlacement:
    """Extrinsics of the camera: nominally it faces -x, image right +z, image down +y."""

    camera_position: list[float] = parameter(
        [0.4175, 0.0, 0.05], "camera position in winder_axis [m]", low=-10.0, high=10.0
    )
    camera_tilt: list[float] = parameter(
        [0.0, 0.0, 0.0],
        "rotation of the camera from facing -x, image right +z, image down +y [rad]",
        low=-0.5,
        high=0.5,
    )
