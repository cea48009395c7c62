"""What lies on the cylinder so far: a path that grows, and is taken back when cable unwinds."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_ROOM = 4096
_NOTHING = np.empty(0)


class Growth(NamedTuple):
    """How a laid path has changed.

    Attributes:
        kept: How many of its points are as they were told before; the others are gone.
        theta: Wound angles that came after them, ascending [rad], shape (n,).
        z: Axial positions there [m], shape (n,).
    """

    kept: int
    theta: FloatArray
    z: FloatArray


class LaidPath:
    """Axial position and undeformed length over the wound angle, point by point from P0 on.

    A point costs the same however many there are.
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

    @property
    def z(self) -> FloatArray:
        """Axial positions there [m], shape (n,); a view."""
        return self._points[1, : self._count]

    @property
    def length(self) -> FloatArray:
        """Undeformed length from P0 to there [m], shape (n,); a view."""
        return self._points[2, : self._count]

    def point(self, index: int) -> tuple[float, float, float]:
        """Return wound angle [rad], axial position [m] and undeformed length [m] of a point."""
        theta, z, length = self._points[:, : self._count][:, index]
        return float(theta), float(z), float(length)

    def append(self, theta: float, z: float, length: float) -> None:
        """Add a point behind the last one; wound angle [rad] and length [m] ascend."""
        count = self._count
        if count == self._points.shape[1]:
            grown = np.zeros((3, 2 * count))
            grown[:, :count] = self._points
            self._points = grown
        self._points[0, count] = theta
        self._points[1, count] = z
        self._points[2, count] = length
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

    def tell_anew(self) -> None:
        """Have the next growth begin with P0."""
        self._kept = 0
