"""Pictures of a case as the paper measured it, at any time of the drive's programme."""

import numpy as np
from numpy.typing import NDArray

from winding_core.cable.condition import Condition
from winding_rig_node.camera.cable_path import CablePath
from winding_rig_node.camera.config import CameraConfig
from winding_rig_node.camera.renderer import Renderer
from winding_rig_node.camera.scene import Scene
from winding_rig_node.lay.known_lay import published_lay
from winding_rig_node.ros.camera import reading_of

DURATION = 20.0  # How long every published run was wound, at least [s]


class Pictures:
    """Draws frames of one case.

    Attributes:
        drive: Its programme.
        shape: Of a frame (rows, columns, 3).
        calibration: Of its camera.
    """

    def __init__(self, case: int) -> None:
        self._what = Condition(case=case, duration=DURATION).resolved()
        self.drive = self._what.drive
        end = float(self.drive.positions(DURATION)[0])
        lay = published_lay(self._what.case, self.drive, self._what.free_length, end)
        self._path = CablePath(theta=lay.path_theta, z=lay.path_z)
        self._marker_theta = lay.marker_theta
        config = CameraConfig()
        self._renderer, self._noise = Renderer(config), np.random.default_rng(1)
        self.calibration = reading_of(config.calibration())
        window = self.calibration.window
        self.shape = (window.height // window.binning, window.width // window.binning, 3)

    def at(self, t: float) -> NDArray[np.uint8]:
        """Return the frame at a time of the programme [s]."""
        angle, way = self.drive.positions(t)
        return self._renderer.render(
            Scene(
                cylinder_radius=self._what.case.cylinder_radius,
                cable_radius=self._what.case.cable_radius,
                cylinder_angle=float(angle),
                cylinder_speed=float(self.drive.speeds(t)[0]),
                path=self._path,
                marker_theta=self._marker_theta,
                guide_z=float(way),
                free_length=self._what.free_length,
                band_width=0.006,
            ),
            self._noise,
        )
