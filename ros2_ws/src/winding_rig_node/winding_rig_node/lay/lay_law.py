"""What a lay law of the simulated machine offers, the laws by name, and the path that they grow.

A law of its own is a class that fulfils `MotionLay`, in a module of its own, and a line in
`MOTION_LAYS`: it is then a value of the parameter and of the option `lay`.
"""

import importlib
from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from winding_core.cable.cases import Case
from winding_core.machine.drum import Drum
from winding_core.machine.readings import GuidePlace

FloatArray = NDArray[np.float64]

# Laws that follow the motion of both axes: name -> module and function of case, generator and drum.
# Named rather than imported: whoever reads the parameters compiles no kernel.
MOTION_LAYS: Mapping[str, str] = {
    "driven": "winding_rig_node.lay.driven_lay:drawn_lay",
}

_ROOM = 4096
_NOTHING = np.empty(0)


class Growth(NamedTuple):
    """How a laid path has changed."""

    kept: int  # How many of its points are as in the last growth; the others are gone
    theta: FloatArray  # Wound angles that came after them, ascending [rad], shape (n,)
    z: FloatArray  # Axial positions there [m], shape (n,)


class LayView(NamedTuple):
    """A motion-driven lay at one instant, relative to the view before."""

    growth: Growth  # What was wound, or taken back, since the last view
    theta: float  # Wound angle at the contact line [rad]
    z: float  # Axial position there [m]
    slope: float  # Rise of the lay there, dz/dtheta [m/rad]
    eye: float  # Where the eye of the guide stands [m]
    free_length: float  # Tangent span between the contact line and the eye, across the axis [m]
    # Wound angles of the markers [rad], shape (marker_count + 1,). A marker in the free span is as
    # many radians beyond the contact line as its way to there is long on the cylinder; nan for one
    # that has not come to the eye yet.
    marker_theta: FloatArray
    # Heights of the growth's points above cable on the bare cylinder [m], shape (n,); (0,) for none
    lift: FloatArray = _NOTHING
    landing_lift: float = 0.0  # Height above it at the contact line [m]


class LayTruth(NamedTuple):
    """Where the cable lies, and what the rig did to it."""

    hidden: Mapping[str, float]  # Hidden properties of the rig by name; empty where there are none
    wound_angle: float  # Of the cylinder [rad]
    theta: FloatArray  # Wound angles of the path [rad], shape (n,)
    z: FloatArray  # Axial positions there [m], shape (n,)
    # Undeformed length from P0 to there [m], shape (n,); (0,) where it is unknown.
    length: FloatArray
    # Wound angles of the markers [rad], shape (m,); nan for one that has not landed.
    marker_theta: FloatArray
    marker_z: FloatArray  # Axial positions there [m], shape (m,)
    # Of the centre line there [m], shape (n,); (0,) on a bare cylinder.
    radius: FloatArray = _NOTHING
    # Counted from 1 on the drum, shape (n,); (0,) on a bare cylinder.
    layer: NDArray[np.int64] = np.empty(0, dtype=np.int64)


class MotionLay(Protocol):
    """A lay that the motion of both axes makes, step by step."""

    def restart(self) -> None:
        """Begin anew with P0 at the contact line of a bare cylinder."""
        ...

    def advance(
        self, angle: float, carriage: float, pull: float, guide: GuidePlace | None = None
    ) -> None:
        """Go on to where both axes stand now.

        Args:
            angle: Of the cylinder [rad].
            carriage: Its position [m].
            pull: On the cable at the guide [N].
            guide: Where the eye stands across the axis; None where it keeps its place.
        """
        ...

    def view(self) -> LayView:
        """Return the lay as it is, by what has changed since the last view."""
        ...

    def renew_view(self) -> None:
        """Have the next view begin with P0."""
        ...

    def truth(self, turned: float) -> LayTruth:
        """Return where the cable lies with the cylinder at an angle [rad]."""
        ...


def motion_lay(
    name: str, case: Case, rng: np.random.Generator, drum: Drum | None = None
) -> MotionLay:
    """Return a new lay of a law of `MOTION_LAYS`.

    Args:
        name: Of the law.
        case: What is wound.
        rng: Draws hidden properties of the rig.
        drum: Between whose flanges; None for a bare cylinder.

    Raises:
        KeyError: There is no such law.
        ValueError: The law cannot wind the case.
    """
    module, _, function = MOTION_LAYS[name].partition(":")
    make: Callable[[Case, np.random.Generator, Drum | None], MotionLay]
    make = getattr(importlib.import_module(module), function)
    return make(case, rng, drum)


class LaidPoint(NamedTuple):
    """Wound angle [rad], axial position [m] and undeformed length since P0 [m] of a point."""

    theta: float
    z: float
    length: float


class LaidPath:
    """Axial position and undeformed length over the wound angle, point by point from P0 on.

    It grows, and is taken back when cable unwinds. A point costs the same however many there are.
    """

    def __init__(self) -> None:
        # Rows: wound angle [rad], axial position [m], undeformed length since P0 [m].
        self._points = np.zeros((3, _ROOM))
        self._count = 1
        self._kept = 0

    @property
    def theta(self) -> FloatArray:
        """Wound angles, ascending from 0 [rad], shape (n,); a view."""
        return self._points[0, : self._count]

    def point(self, index: int) -> LaidPoint:
        """Return a point by its index; the last one is -1."""
        return LaidPoint(*map(float, self._points[:, : self._count][:, index]))

    def append(self, theta: float, z: float, length: float) -> None:
        """Add a point behind the last one; wound angle [rad] and length [m] ascend."""
        count = self._count
        if count == self._points.shape[1]:
            self._points = np.concatenate([self._points, np.zeros_like(self._points)], axis=1)
        self._points[:, count] = theta, z, length
        self._count = count + 1

    def take_back(self, theta: float) -> None:
        """Forget the points at and beyond a wound angle [rad], except P0."""
        self._count = max(int(np.searchsorted(self.theta, theta, side="left")), 1)
        self._kept = min(self._kept, self._count)

    def growth(self) -> Growth:
        """Return what has changed since the last call."""
        kept, count = self._kept, self._count
        if kept == count:
            return Growth(kept, _NOTHING, _NOTHING)
        self._kept = count
        theta, z = self._points[:2, kept:count].copy()
        return Growth(kept, theta, z)

    def renew_growth(self) -> None:
        """Have the next growth begin with P0."""
        self._kept = 0

    def along(self, theta: ArrayLike, end: LaidPoint) -> tuple[FloatArray, FloatArray]:
        """Interpolate the path, and on to the contact line.

        Args:
            theta: Wound angles [rad], any shape.
            end: At the contact line, at or beyond the last point.

        Returns:
            Axial positions [m] and undeformed lengths since P0 [m], same shape; nan beyond the
            lay.
        """
        theta = np.asarray(theta, dtype=float)
        known, last = self.theta, self.point(-1)
        outside = (theta < 0.0) | (theta > end.theta)
        found = []
        for row in (1, 2):
            values = np.interp(theta, known, self._points[row, : self._count])
            if end.theta > last.theta:
                share = (theta - last.theta) / (end.theta - last.theta)
                beyond = last[row] + share * (end[row] - last[row])
                values = np.where(share > 0.0, beyond, values)
            found.append(np.where(outside | np.isnan(theta), np.nan, values))
        return found[0], found[1]

    def truth(
        self, end: LaidPoint, marker_theta: FloatArray, hidden: Mapping[str, float]
    ) -> LayTruth:
        """Return what lies up to the contact line.

        Args:
            end: At the contact line.
            marker_theta: Wound angles of the markers [rad]; nan for one that has not landed.
            hidden: Hidden properties of the rig by name [SI].
        """
        theta = np.append(self.theta, end.theta)
        z, length = self.along(theta, end)
        return LayTruth(
            hidden=hidden,
            wound_angle=end.theta,
            theta=theta,
            z=z,
            length=length,
            marker_theta=marker_theta,
            marker_z=self.along(marker_theta, end)[0],
        )
