"""The lay as the camera sees it: one that is known ahead, or one that is wound as it goes."""

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from winding_core.cable.cases import Case
from winding_rig_node.camera.cable_path import CablePath, GrowingPath, WoundPath
from winding_rig_node.camera.scene import Scene
from winding_rig_node.lay.known_lay import CableLay
from winding_rig_node.lay.lay_law import LayView

FloatArray = NDArray[np.float64]


class SeenLay(NamedTuple):
    """What a `Scene` needs of a lay; see there."""

    path: WoundPath  # Axial position of the wound cable
    marker_theta: FloatArray  # Wound angle of each marker [rad], shape (m,)
    guide_z: float  # Axial position of the guide's eye [m]
    free_length: float  # Distance of the eye before the contact line [m]

    def scene(self, case: Case, cylinder_angle: float, **further: Any) -> Scene:
        """Return the scene with this lay of a case's cable at an angle [rad]; see `Scene`."""
        return Scene(
            cylinder_radius=case.cylinder_radius,
            cable_radius=case.cable_radius,
            cylinder_angle=cylinder_angle,
            **self._asdict(),
            **further,
        )


class ShownLay(Protocol):
    """A lay before the camera."""

    def at(self, carriage: float, view: LayView | None) -> SeenLay:
        """Return what is seen of it with the carriage at a place [m]."""
        ...


class KnownLay:
    """A lay that is known ahead, whatever the machine does; the eye stands on the carriage.

    Args:
        lay: The lay.
        free_length: Distance of the eye before the contact line [m].
    """

    def __init__(self, lay: CableLay, free_length: float) -> None:
        self._path = CablePath(theta=lay.path_theta, z=lay.path_z)
        self._marker_theta = lay.marker_theta
        self._free_length = free_length

    def at(self, carriage: float, view: LayView | None) -> SeenLay:
        """Return what is seen of it with the carriage at a place [m]; there are no views of it."""
        return SeenLay(
            path=self._path,
            marker_theta=self._marker_theta,
            guide_z=carriage,
            free_length=self._free_length,
        )


class GrowingLay:
    """A lay that is wound as the machine goes, followed view by view."""

    def __init__(self, first: LayView, *, lifted: bool = False) -> None:
        self._path = GrowingPath(lifted=lifted)
        self._seen = self._after(first)

    def at(self, carriage: float, view: LayView | None) -> SeenLay:
        """Return what is seen of it after a view; as it was seen last without one."""
        if view is not None:
            self._seen = self._after(view)
        return self._seen

    def _after(self, view: LayView) -> SeenLay:
        self._path.grow(*view.growth, view.lift if view.lift.size else None)
        self._path.end(view.theta, view.z, view.slope, view.landing_lift)
        return SeenLay(
            path=self._path,
            marker_theta=view.marker_theta,
            guide_z=view.eye,
            free_length=view.free_length,
        )
