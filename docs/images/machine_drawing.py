"""The winding machine in oblique view: cylinder, wound cable, markers, guide on its carriage."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Towards the viewer, who stands before the cylinder and above it; the cable comes from behind.
VIEWER = np.array([0.62, 0.70, 0.36]) / np.linalg.norm([0.62, 0.70, 0.36])
LIGHT = np.array([0.85, 0.30, 0.42]) / np.linalg.norm([0.85, 0.30, 0.42])
RIGHT = np.cross([1.0, 0.0, 0.0], VIEWER) / np.linalg.norm(np.cross([1.0, 0.0, 0.0], VIEWER))
UP = np.cross(VIEWER, RIGHT)
STEEL, DARK, CABLE, MARKER = "#9aa3ad", "#5b6570", "#d9d4ca", "#e8b400"
# Of the drawn cylinder beyond the lay, and of its shaft [m].
BEYOND, SHAFT, SHAFT_RADIUS = 16.0e-3, 14.0e-3, 5.0e-3
BAND = 6.0e-3


@dataclass(frozen=True, kw_only=True)
class Machine:
    """What does not change over a run.

    Attributes:
        radius: R of the cylinder [m].
        cable_radius: r [m].
        free_length: Of the span between cylinder and guide [m].
        travel: Way of the guide over the run [m].
    """

    radius: float
    cable_radius: float
    free_length: float
    travel: float

    def draw(self, axes: Axes, angle: float, guide_z: float, cable: Array, markers: Array) -> None:
        """Draw one instant.

        Args:
            axes: Drawn upon; one unit is a metre.
            angle: Of the cylinder [rad].
            guide_z: Position of the guide [m].
            cable: Nodes in the lab frame [m], shape (n, 3), from P0 to the guide.
            markers: Places of the bands to be drawn [m], shape (m, 3).
        """
        ends = (-BEYOND, self.travel + BEYOND)
        self._rail(axes, guide_z)
        self._barrel(axes, SHAFT_RADIUS, (ends[0] - SHAFT, ends[0]), DARK)
        self._barrel(axes, self.radius, ends, STEEL)
        self._cap(axes, ends[1], angle)
        self._barrel(axes, SHAFT_RADIUS, (ends[1], ends[1] + SHAFT), DARK)
        path = self._smooth(cable)
        wide = self._points(axes, 2.0 * self.cable_radius)
        self._line(axes, path, wide, "#6f6a60", self._visible(path))
        self._line(axes, path, 0.72 * wide, CABLE, self._visible(path))
        for place in markers:
            near = self._band(path, place)
            self._line(axes, near, 0.95 * wide, MARKER, self._visible(near))

    def limits(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return what the picture must show, left to right and bottom to top [m]."""
        far = self.radius + 10.0e-3
        corners = _seen(
            [
                (x, y, z)
                for x in (-far, far)
                for y in (-self.free_length - 0.012, far)
                for z in (-BEYOND - SHAFT, self.travel + BEYOND + SHAFT)
            ]
        )
        low, high = corners.min(axis=0), corners.max(axis=0)
        return (low[0], high[0]), (low[1], high[1])

    def _smooth(self, cable: Array) -> Array:
        """Return the cable with many nodes a turn: round on the cylinder, straight in the span."""
        x, y, z = cable.T
        azimuth = np.unwrap(np.arctan2(y, x))
        wound = int(np.argmax(np.hypot(x, y) > 1.15 * (self.radius + self.cable_radius))) or len(x)
        place = np.arange(wound)
        fine = np.linspace(0.0, wound - 1.0, 12 * wound)
        turned, along = np.interp(fine, place, azimuth[:wound]), np.interp(fine, place, z[:wound])
        rho = self.radius + self.cable_radius
        lying = np.column_stack([rho * np.cos(turned), rho * np.sin(turned), along])
        return np.vstack([lying, cable[wound:]])

    def _band(self, path: Array, place: Array) -> Array:
        """Return the cable under a marker's band, of the turn that lies nearest to it."""
        middle = int(np.argmin(np.linalg.norm(path - place, axis=1)))
        way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        return path[np.abs(way - way[middle]) < 0.6 * BAND]

    def _visible(self, path: Array) -> NDArray[np.bool_]:
        normal = path * (1.0, 1.0, 0.0)
        free = path[:, 1] < -0.9 * self.radius
        return (normal @ VIEWER > 0.08 * self.radius) | (free & (path[:, 0] > 0.5 * self.radius))

    def _line(
        self, axes: Axes, path: Array, width: float, colour: str, shown: NDArray[np.bool_]
    ) -> None:
        seen = _seen(path)
        if len(seen) < 2:
            return
        pieces = np.split(np.arange(len(seen)), np.flatnonzero(np.diff(shown)) + 1)
        lines = [seen[piece] for piece in pieces if shown[piece[0]] and len(piece) > 1]
        axes.add_collection(
            LineCollection(lines, linewidths=width, colors=colour, capstyle="round", zorder=5)
        )

    def _points(self, axes: Axes, length: float) -> float:
        """Return a length [m] on these axes in typographic points."""
        (left, _), (right, _) = axes.transData.transform([(0.0, 0.0), (length, 0.0)])
        return float((right - left) * 72.0 / axes.figure.dpi)

    def _barrel(self, axes: Axes, radius: float, ends: tuple[float, float], colour: str) -> None:
        around = np.linspace(0.0, 2.0 * np.pi, 97)
        middle = 0.5 * (around[:-1] + around[1:])
        normal = np.column_stack([np.cos(middle), np.sin(middle), np.zeros(96)])
        shown = normal @ VIEWER > -0.05
        light = 0.45 + 0.6 * np.clip(normal @ LIGHT, 0.0, 1.0) ** 1.5
        base = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
        rims = [
            _seen(
                np.column_stack([radius * np.cos(around), radius * np.sin(around), np.full(97, z)])
            )
            for z in ends
        ]
        strips = [
            [rims[0][k], rims[0][k + 1], rims[1][k + 1], rims[1][k]] for k in np.flatnonzero(shown)
        ]
        colours = np.clip(light[shown, None] * base * 1.25, 0.0, 1.0)
        axes.add_collection(
            PolyCollection(strips, facecolors=colours, edgecolors=colours, zorder=3)
        )

    def _cap(self, axes: Axes, z: float, angle: float) -> None:
        around = np.linspace(0.0, 2.0 * np.pi, 97)

        def disc(radius: float, x: float = 0.0, y: float = 0.0) -> Array:
            ring = np.column_stack(
                [x + radius * np.cos(around), y + radius * np.sin(around), np.full(97, z)]
            )
            return _seen(ring)

        axes.add_collection(PolyCollection([disc(self.radius)], facecolors="#b7bfc8", zorder=4))
        # Holes that turn with it.
        holes = [
            disc(
                0.17 * self.radius,
                0.66 * self.radius * np.cos(angle + part),
                0.66 * self.radius * np.sin(angle + part),
            )
            for part in np.arange(3) * 2.0 * np.pi / 3.0
        ]
        axes.add_collection(PolyCollection(holes, facecolors="#3d444c", zorder=4))

    def _rail(self, axes: Axes, guide_z: float) -> None:
        y, x = -self.free_length, self.radius + self.cable_radius
        low = x - 26.0e-3
        rail = _seen([(low, y, -BEYOND), (low, y, self.travel + BEYOND)])
        axes.plot(*rail.T, color=DARK, linewidth=5.0, solid_capstyle="round", zorder=1)
        half = 7.0e-3
        foot = [
            (low - 4e-3, y, guide_z - half), (low - 4e-3, y, guide_z + half),
            (low + 8e-3, y, guide_z + half), (low + 8e-3, y, guide_z - half),
        ]  # fmt: skip
        axes.add_collection(PolyCollection([_seen(foot)], facecolors="#3f7fbf", zorder=2))
        post = _seen([(low + 8e-3, y, guide_z), (x, y, guide_z)])
        axes.plot(*post.T, color="#3f7fbf", linewidth=4.0, zorder=2)
        axes.plot(*post[1], "o", color="#3f7fbf", markersize=11.0, zorder=6)
        axes.plot(*post[1], "o", color="white", markersize=5.0, zorder=7)


def _seen(points: object) -> Array:
    """Return where lab points [m] stand in the picture, shape (n, 2) [m]."""
    places = np.asarray(points, dtype=float)
    return np.column_stack([places @ RIGHT, places @ UP])
