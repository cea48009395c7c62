"""The turning cylinder with the predicted cable and the tracked markers, from where one looks.

A parallel projection drawn from behind to the front: it needs no WebGL, and the cylinder hides what
is behind it.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from winding_core.markers import MarkerFlag
from winding_dashboard.drawings.palette import DRUM, EDGE, INK, MEASURED, PAPER, tension_colours
from winding_dashboard.state.view_state import ViewState

_TOP = 0.07  # The span to the guide leaves the picture above this height over the axis [m]
CABLE_POINTS = 360  # Enough dots to look like a cable and few enough to send five times a second
# A tension that varies by less is one colour [N]; the load cell's noise is 0.01 N.
_LEAST_SPREAD = 0.05
# The cylinder is drawn from here to there, and further when the carriage goes further [m].
_FROM, _TO, _BEYOND = -0.02, 0.125, 0.02
SIZE = (660.0, 250.0)
_MARGIN = 18.0
_PIECE = 6  # Dots of the cable that have one colour
# The free span, which nothing hides, leaves the cylinder within so much of its radius.
_SHORT = 0.2
_LEAST_WIDTH, _LEAST_DOT = 1.6, 3.5
_FLANGE_OPACITY = 0.5  # Of the near flange, behind which cable and markers show


@dataclass(frozen=True, kw_only=True)
class CableShape:
    """The cable as dots."""

    points: NDArray[np.float64]  # In the lab frame, shape (n, 3) [m]
    share: NDArray[np.float64]  # Of the tension between low and high, shape (n,)
    low: float  # Least tension [N]
    high: float  # Largest tension [N]


def cable_shape(cable: NDArray[np.void], count: int = CABLE_POINTS) -> CableShape | None:
    """Return the cable's nodes as evenly spaced dots; None for less than two finite nodes.

    Args:
        cable: Records of CABLE_DTYPE, in order along the cable.
        count: Number of dots.
    """
    nodes = np.stack([cable[name] for name in ("x", "y", "z")], axis=1).astype(float)
    tension = cable["tension"].astype(float)
    finite = np.isfinite(nodes).all(axis=1) & np.isfinite(tension) & (nodes[:, 1] > -_TOP)
    nodes, tension = nodes[finite], tension[finite]
    if len(nodes) < 2:
        return None
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(nodes, axis=0), axis=1))])
    at = np.linspace(0.0, way[-1], count)
    dots = np.stack([np.interp(at, way, column) for column in nodes.T], axis=1)
    along = np.interp(at, way, tension)
    low, high = float(tension.min()), float(tension.max())
    share = (along - low) / max(high - low, _LEAST_SPREAD)
    return CableShape(points=dots, share=share, low=low, high=high)


@dataclass(frozen=True, kw_only=True)
class Sight:
    """From where one looks."""

    yaw: float = math.radians(-14.0)  # About the vertical, positive to the right [rad]
    pitch: float = math.radians(18.0)  # From above [rad]

    @property
    def rows(self) -> NDArray[np.float64]:
        """Rows right, up and towards the eye of lab vectors, shape (3, 3).

        From straight ahead one looks as the camera does: +z to the right, -y up, +x towards one.
        """
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        d, t = math.cos(self.pitch), math.sin(self.pitch)
        ahead = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
        turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
        nod = np.array([[1.0, 0.0, 0.0], [0.0, d, -t], [0.0, t, d]])
        return np.asarray(nod @ turn @ ahead)


def cylinder_drawing(state: ViewState, sight: Sight) -> str:
    """Return the inside of an SVG element of SIZE; nothing before any prediction or measurement."""
    radius = state.centreline_radius - state.cable_radius
    if state.axes is None or not radius > 0.0:
        return ""
    label = state.label
    if label is not None and label.flanges is not None:
        first = state.predicted["z"][state.predicted["id"] == 0]
        begin = float(first[0]) if first.size and math.isfinite(first[0]) else 0.0
        ends = begin + label.flanges.low, begin + label.flanges.high
        rim = label.flanges.radius
    else:
        ends, rim = (_FROM, max(_TO, state.axes.carriage_position + _BEYOND)), radius
    return _Drawing(state, sight, radius, ends, rim).svg()


def tension_ends(state: ViewState) -> tuple[float, float] | None:
    """Return least and largest tension of the drawn cable [N]; None without one."""
    shape = cable_shape(state.cable)
    return None if shape is None else (shape.low, shape.high)


class _Drawing:
    def __init__(
        self,
        state: ViewState,
        sight: Sight,
        radius: float,
        ends: tuple[float, float],
        rim: float,
    ) -> None:
        self._state, self._radius, self._ends, self._rim = state, radius, ends, rim
        self._rows = sight.rows
        corners = np.array(
            [[x, y, z] for x in (-rim, rim) for y in (-rim, rim) for z in ends], dtype=float
        )
        seen = corners @ self._rows.T
        low, high = seen[:, :2].min(axis=0), seen[:, :2].max(axis=0)
        room = np.array(SIZE) - 2.0 * _MARGIN
        self._scale = float((room / (high - low)).min())
        self._middle = 0.5 * (low + high)

    def svg(self) -> str:
        """Return everything from behind to the front."""
        behind, before = self._cable()
        far, body, near = self._drum()
        return far + behind + body + before + self._markers() + near

    def _pixels(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        seen = points @ self._rows.T
        flat = (seen[:, :2] - self._middle) * self._scale * (1.0, -1.0)
        return np.asarray(flat + 0.5 * np.array(SIZE))

    def _near(self, points: NDArray[np.float64], margin: float = 0.0) -> NDArray[np.bool_]:
        """Return which points of the surface face the eye."""
        outward = points * (1.0, 1.0, 0.0)
        length = np.maximum(np.linalg.norm(outward, axis=1), 1.0e-9)
        near: NDArray[np.bool_] = (outward @ self._rows[2]) / length > margin
        return near

    def _drum(self) -> tuple[str, str, str]:
        """Return the far flange, the cylinder, and the near flange, through which one sees."""
        ends = self._pixels(np.array([[0.0, 0.0, z] for z in self._ends]))
        along = ends[1] - ends[0]
        angle = math.atan2(along[1], along[0])
        across = self._radius * self._scale
        # A circle about the axis is as flat as the axis points at the eye.
        flat = abs(float(self._rows[2, 2])) * across
        side = across * np.array([-math.sin(angle), math.cos(angle)])
        shape = " ".join(
            f"{u:.1f},{v:.1f}"
            for u, v in (ends[0] + side, ends[1] + side, ends[1] - side, ends[0] - side)
        )
        near, far = (1, 0) if self._rows[2, 2] > 0.0 else (0, 1)

        def disc(i: int, larger: float, opacity: float) -> str:
            u, v = ends[i]
            return (
                f'<ellipse cx="{u:.1f}" cy="{v:.1f}" rx="{larger * flat:.1f}" '
                f'ry="{larger * across:.1f}" transform="rotate({math.degrees(angle):.1f} {u:.1f} '
                f'{v:.1f})" fill="{DRUM}" fill-opacity="{opacity:g}" stroke="{EDGE}"/>'
            )

        outline = f'<polygon points="{shape}" fill="{DRUM}"/>'
        edges = "".join(
            f'<path d="M{a[0]:.1f} {a[1]:.1f}L{b[0]:.1f} {b[1]:.1f}" stroke="{EDGE}"/>'
            for a, b in ((ends[0] + s, ends[1] + s) for s in (side, -side))
        )
        body = disc(far, 1.0, 1.0) + outline + edges + disc(near, 1.0, 1.0) + self._line_of_p0()
        if self._rim == self._radius:
            return "", body, ""
        larger = self._rim / self._radius
        return disc(far, larger, 1.0), body, disc(near, larger, _FLANGE_OPACITY)

    def _line_of_p0(self) -> str:
        """Return a line along the cylinder at P0's azimuth, so that one sees it turn."""
        turned = self._state.drum_angle
        foot = self._radius * np.array([math.cos(turned), math.sin(turned)])
        line = np.array([[*foot, z] for z in self._ends])
        if not self._near(line).all():
            return ""
        (a, b), (c, d) = self._pixels(line)
        return (
            f'<path d="M{a:.1f} {b:.1f}L{c:.1f} {d:.1f}" stroke="{EDGE}" stroke-width="2" '
            'stroke-dasharray="6 4"/>'
        )

    def _cable(self) -> tuple[str, str]:
        """Return the cable behind the cylinder and before it."""
        shape = cable_shape(self._state.cable)
        if shape is None:
            return "", ""
        pixels = self._pixels(shape.points)
        x, y, _ = shape.points.T
        landed = np.flatnonzero((y > -_SHORT * self._radius) & (x > 0.0))
        outside = np.arange(x.size) > landed.max(initial=-1)
        before = self._near(shape.points) | outside
        width = max(2.0 * self._state.cable_radius * self._scale, _LEAST_WIDTH)
        sides = {True: "", False: ""}
        for start, stop in _pieces(before):
            sides[bool(before[start])] += _strand(shape, pixels, start, stop, width)
        return sides[False], sides[True]

    def _markers(self) -> str:
        state = self._state
        records = state.tracked
        xyz = np.stack([records[name] for name in ("x", "y", "z")], axis=1).astype(float)
        shown = np.isfinite(xyz).all(axis=1) & ((records["flags"] & MarkerFlag.NOT_WOUND) == 0)
        c, s = math.cos(state.marker_turn), math.sin(state.marker_turn)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        points = xyz[shown] @ turn.T
        near = self._near(points)
        dot = max(1.2 * state.cable_radius * self._scale, _LEAST_DOT)
        parts = []
        numbers = records["id"][shown][near]
        for number, (u, v) in zip(numbers, self._pixels(points[near]), strict=True):
            # Neighbouring turns nearly touch: their names stand above and below.
            beside = v - dot - 4.0 if number % 2 == 0 else v + dot + 12.0
            parts.append(
                f'<circle cx="{u:.1f}" cy="{v:.1f}" r="{dot:.1f}" fill="{MEASURED}" '
                f'stroke="{INK}"/><text x="{u:.1f}" y="{beside:.1f}" text-anchor="middle" '
                f'font-size="13" font-weight="700" fill="{PAPER}" stroke="{INK}" '
                f'stroke-width="3" paint-order="stroke">P{int(number)}</text>'
            )
        return "".join(parts)


def _pieces(before: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return first and last dot of pieces that lie on one side and have one colour."""
    cuts = {0, len(before) - 1, *(np.flatnonzero(np.diff(before)) + 1).tolist()}
    cuts |= set(range(0, len(before), _PIECE))
    places = sorted(cuts)
    return list(itertools.pairwise(places))


def _strand(
    shape: CableShape, pixels: NDArray[np.float64], start: int, stop: int, width: float
) -> str:
    line = " ".join(f"{u:.1f},{v:.1f}" for u, v in pixels[start : stop + 1])
    colour = tension_colours(shape.share[start : start + 1])[0]
    return (
        f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="{width:.1f}" '
        'stroke-linecap="round"/>'
    )
