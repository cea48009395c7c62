"""The path of a cable that is being wound: drawn at the same cost however long it is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from winding_rig_node.camera.cable_path import BLOCK_ANGLE, PathTable

FloatArray = NDArray[np.float64]

_ROOM = 4096
# The lay goes on by so much beyond the contact line, for its direction there [rad].
_AHEAD = 0.02
# Nearer to the last point than this a line through both says nothing [rad].
_CLOSE = 1.0e-4
# Beside the points and the blocks: what lies ahead of the contact line, and where that ends.
_SPARE = 2


class _Point(NamedTuple):
    """A point, the number of its block, and the bounds of that block up to there."""

    theta: float
    z: float
    block: int
    lowest: float
    highest: float


class GrowingPath:
    """Axial position of the cable wound so far, piecewise linear in the wound angle.

    It belongs to one thread. Beyond its ends it is level, as a `CablePath`.

    Attributes:
        table: Its points with the bounds of blocks, for the renderer; until the next change.
    """

    def __init__(self) -> None:
        self._points = np.zeros((2, _ROOM))
        self._first = np.zeros(_ROOM, dtype=np.int64)
        self._bounds = np.zeros((2, _ROOM))
        self._lift = np.zeros(0)
        self._count = 0
        self._shape = 0, 0
        self._start = 0.0
        self._last: _Point | None = None

    def grow(self, kept: int, theta: FloatArray, z: FloatArray) -> None:
        """Forget the points after the first so many, and go on with others.

        Args:
            kept: How many points stay.
            theta: Wound angles of those that follow, ascending [rad], shape (n,).
            z: Axial positions there [m], shape (n,).

        Raises:
            ValueError: There are not so many points.
        """
        if kept != self._count:
            self._take_back(kept)
        for point in zip(theta.tolist(), z.tolist(), strict=True):
            self._last = self._put(self._count, *point)
            self._count += 1

    def end(self, theta: float, z: float, slope: float) -> None:
        """Have it end at the contact line, in place of where it ended before.

        Args:
            theta: Wound angle there, at or after the last point [rad].
            z: Axial position there [m].
            slope: Rise there, dz/dtheta [m/rad].
        """
        last = self._last
        if last is not None and theta - last.theta > _CLOSE:
            # One line from the last point through the contact line.
            slope = (z - last.z) / (theta - last.theta)
        if last is None:
            self.grow(0, np.array([theta]), np.array([z]))
            last = self._last
        ahead = self._put(self._count, theta + _AHEAD, z + _AHEAD * slope)
        self._last = last
        if (self._count + 1, ahead.block + 1) != self._shape:
            self._tabulate(self._count + 1, ahead.block + 1)

    def height(self, theta: FloatArray) -> FloatArray:
        """Return z [m] at wound angles [rad], of their shape; nan for nan."""
        return np.asarray(np.interp(theta, self.table.theta, self.table.z), dtype=float)

    def lifted(self, theta: FloatArray) -> FloatArray:
        """Return the lift [m] at wound angles [rad], of their shape: none."""
        return np.zeros(np.shape(theta))

    def _tabulate(self, size: int, blocks: int) -> None:
        self._shape = size, blocks
        self._first[blocks] = size - 1
        points = self._points[:, :size]
        points.flags.writeable = False
        self.table = PathTable(
            points[0],
            points[1],
            self._lift,
            self._first[: blocks + 1],
            self._bounds[0, :blocks],
            self._bounds[1, :blocks],
        )

    def _take_back(self, kept: int) -> None:
        if not 0 <= kept <= self._count:
            raise ValueError(f"a path of {self._count} points cannot keep {kept}")
        self._count, self._last = kept, None
        if kept > 0:
            theta, z = self._points[:, kept - 1].tolist()
            block = int((theta - self._start) / BLOCK_ANGLE)
            # Bounds of what was there before hold for less, too.
            self._last = _Point(theta, z, block, *self._bounds[:, block].tolist())

    def _put(self, index: int, theta: float, z: float) -> _Point:
        """Write a point after the last one, and the bounds of the blocks on the way to it."""
        last = self._last
        if last is None:
            self._start = theta
            last = _Point(theta, z, -1, z, z)
        block = int((theta - self._start) / BLOCK_ANGLE)
        while max(index, block) + _SPARE >= self._first.size:
            self._grow_room()
        self._points[0, index], self._points[1, index] = theta, z
        lowest, highest = min(last.z, z), max(last.z, z)
        if block == last.block:
            point = _Point(theta, z, block, min(last.lowest, lowest), max(last.highest, highest))
        else:
            if last.block >= 0:
                self._bounds[0, last.block] = min(last.lowest, lowest)
                self._bounds[1, last.block] = max(last.highest, highest)
            for begun in range(last.block + 1, block + 1):
                self._first[begun] = max(index - 1, 0)
                self._bounds[:, begun] = lowest, highest
            point = _Point(theta, z, block, lowest, highest)
        self._bounds[0, block], self._bounds[1, block] = point.lowest, point.highest
        return point

    def _grow_room(self) -> None:
        self._shape = 0, 0
        self._points = np.concatenate([self._points, np.zeros_like(self._points)], axis=1)
        self._first = np.concatenate([self._first, np.zeros_like(self._first)])
        self._bounds = np.concatenate([self._bounds, np.zeros_like(self._bounds)], axis=1)
