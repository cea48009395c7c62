"""The arm that carries the guide, along the cylinder's axis and from where cable lands."""

from __future__ import annotations

import contextlib
import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from winding_core.arm.opening import arm_beside
from winding_dashboard.drawings.palette import DRUM, EDGE, MEASURED, PAPER
from winding_dashboard.state.view_state import ViewState

if TYPE_CHECKING:
    from winding_core.arm.arm_path import ArmPath

SIZE = (660.0, 230.0)
_MARGIN, _LINK, _JOINT = 14.0, 5.0, 3.6
# The cylinder is drawn up to here, and further when the guide goes further [m].
_END, _MORE = 0.125, 0.02
_SAME = 1.0e-4  # Radii of one condition differ by less [m]: they come as single precision


class ArmView:
    """Draws the arm where the newest reading has its eye.

    Args:
        file: Of the arm; empty for a machine without one.
    """

    def __init__(self, file: str = "") -> None:
        self.file = file
        self._radius = math.nan
        self._path: ArmPath | None = None
        self._joints = np.zeros(0)

    def svg(self, state: ViewState) -> str:
        """Return the inside of an SVG element of SIZE; empty before the guide's place is known."""
        axes, radius = state.axes, state.centreline_radius
        if not self.file or axes is None or axes.guide is None or not radius > 0.0:
            return ""
        along = axes.carriage_position
        # Nothing is drawn of a file that cannot be used for this cable, which the rig refuses, too.
        with contextlib.suppress(ValueError):
            if not math.isclose(radius, self._radius, abs_tol=_SAME):
                # Another cable is wound, or the first one.
                self._radius, self._path = radius, None
                self._path = arm_beside(self.file, radius, -axes.guide.y)
                self._joints = self._path.start if self._path is not None else self._joints
            if self._path is not None:
                # Where the arm does not reach, it stays as it was drawn last.
                self._joints = self._path.joints_at(along, self._joints)
        if self._path is None:
            return ""
        bare = radius - state.cable_radius
        return self._drawing(self._path, bare, max(_END, along + _MORE))

    def _drawing(self, path: ArmPath, radius: float, end: float) -> str:
        links = path.links(self._joints)
        half = 0.5 * SIZE[0]
        side = _Panel(links[:, [1, 0]], radius, (-radius, radius), 0.0)
        plan = _Panel(links[:, [1, 2]], radius, (0.0, end), half)
        u, v = side.at(np.zeros(2))
        drums = (
            f'<circle cx="{u:.1f}" cy="{v:.1f}" r="{side.scale * radius:.1f}" '
            f'fill="{DRUM}" stroke="{EDGE}"/>',
            plan.box(),
        )
        land = np.array([0.0, links[-1, 0]]), np.array([0.0, links[-1, 2]])
        return "".join(
            drum + panel.arm(where)
            for drum, panel, where in zip(drums, (side, plan), land, strict=True)
        )


class _Panel:
    """One view: a plane of the machine in half of the picture."""

    def __init__(
        self, points: NDArray[np.float64], radius: float, ends: tuple[float, float], left: float
    ) -> None:
        self._points, self._radius, self._ends = points, radius, ends
        corners = np.concatenate([points, [(-radius, ends[0]), (radius, ends[1])]])
        low, high = corners.min(axis=0), corners.max(axis=0)
        room = np.array((0.5 * SIZE[0], SIZE[1])) - 2.0 * _MARGIN
        self.scale = float((room / np.maximum(high - low, 1.0e-6)).min())
        self._middle = 0.5 * (low + high)
        self._centre = np.array((left + 0.25 * SIZE[0], 0.5 * SIZE[1]))

    def at(self, point: NDArray[np.float64]) -> list[float]:
        """Return where a point of the plane is drawn [px]."""
        place: list[float] = (
            self._centre + (point - self._middle) * self.scale * (1.0, -1.0)
        ).tolist()
        return place

    def box(self) -> str:
        """Return the cylinder from its side."""
        (u, v), (w, x) = (
            self.at(np.array(corner))
            for corner in ((-self._radius, self._ends[1]), (self._radius, self._ends[0]))
        )
        return (
            f'<rect x="{u:.1f}" y="{v:.1f}" width="{w - u:.1f}" height="{x - v:.1f}" '
            f'fill="{DRUM}" stroke="{EDGE}"/>'
        )

    def arm(self, landing: NDArray[np.float64]) -> str:
        """Return the links, the joints, and the span from the eye to where cable lands."""
        drawn = [self.at(point) for point in self._points]
        line = " ".join(f"{u:.1f},{v:.1f}" for u, v in drawn)
        u, v = self.at(landing)
        eye = drawn[-1]
        joints = "".join(
            f'<circle cx="{a:.1f}" cy="{b:.1f}" r="{_JOINT}" fill="{PAPER}" stroke="{EDGE}"/>'
            for a, b in drawn[:-1]
        )
        return (
            f'<line x1="{eye[0]:.1f}" y1="{eye[1]:.1f}" x2="{u:.1f}" y2="{v:.1f}" '
            f'stroke="{MEASURED}" stroke-width="1.6"/>'
            f'<polyline points="{line}" fill="none" stroke="{EDGE}" stroke-width="{_LINK}" '
            f'stroke-linejoin="round" stroke-linecap="round"/>{joints}'
        )
