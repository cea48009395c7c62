"""What lies on a drum turn upon turn, and where further cable comes to rest on it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from winding_core.cable.cases import Case
from winding_core.lay.layers import FULL_TURN, contact_height
from winding_core.machine.drum import Drum

FloatArray = NDArray[np.float64]

_ROOM = 4096
# Cable that lands by more than this of its diameter beside its neighbour slides off it, down to
# its own level; nearer to its top it climbs.
_SLIDES = 0.5
# Neighbours give way by so much of a diameter.
_GIVES = 0.05
# Cable that lies so much of a diameter above another one does not lie beside it.
_LEVEL = 0.5
# Of what cable lies on, all that is so nearly as high bears it, in diameters.
_BEARS = 0.1


class Rest(NamedTuple):
    """Where cable comes to rest."""

    z: float  # Axial position [m]
    radius: float  # Of the centre line [m]
    layer: int  # From 1 on the drum


class LaidTurns:
    """The turns on a drum, point by point.

    A point rests on what was laid at the same place of the circumference before. Cable that it
    touches u beside it holds it sqrt(d^2 - u^2) higher (`winding_core.lay.layers.contact_height`);
    of all that it touches the highest counts, and the drum where there is none. The turn before on
    its own level pushes it aside where there is room for it, up to the flange; a flange is passed
    nowhere. Whatever else lies below does not move it: it sticks where it lands.

    Args:
        drum: Between whose flanges.
        case: What is wound; its undeformed diameter counts.
    """

    def __init__(self, drum: Drum, case: Case) -> None:
        self._diameter = case.cable_diameter
        self._bare = case.centreline_radius
        self._low, self._high = drum.centre_lines(case.cable_diameter)
        # Rows: wound angle [rad], axial position [m], radius [m], layer.
        self._points = np.zeros((4, _ROOM))
        self.restart()

    def restart(self) -> None:
        """Begin anew with P0 on the drum."""
        self._points[:, 0] = 0.0, 0.0, self._bare, 1.0
        self._count = 1

    @property
    def radius(self) -> FloatArray:
        """Radii of the centre line [m], shape (n,); a view."""
        return self._points[2, : self._count]

    @property
    def layer(self) -> NDArray[np.int64]:
        """Layers, from 1 on the drum, shape (n,)."""
        return self._points[3, : self._count].astype(np.int64)

    @property
    def last(self) -> Rest:
        """The newest point."""
        _, z, radius, layer = self._points[:, self._count - 1].tolist()
        return Rest(z, radius, int(layer))

    def within(self, z: float) -> float:
        """Return an axial position [m] between the flanges."""
        return min(max(z, self._low), self._high)

    def append(self, theta: float, z: float) -> Rest:
        """Lay the next point, which the span leads to an axial position.

        Args:
            theta: Its wound angle, beyond the last one [rad].
            z: Where the span leads it [m].

        Returns:
            Where it comes to rest.
        """
        rest = self._rest(theta, self.within(z))
        if self._count == self._points.shape[1]:
            self._points = np.concatenate([self._points, np.zeros_like(self._points)], axis=1)
        self._points[:, self._count] = theta, *rest
        self._count += 1
        return rest

    def take_back(self, count: int) -> None:
        """Forget all points but the first so many, at least P0."""
        self._count = max(count, 1)

    def _rest(self, theta: float, z: float) -> Rest:
        before = theta - FULL_TURN * np.arange(1, math.floor(theta / FULL_TURN) + 1)
        if not before.size:
            return Rest(z, self._bare, 1)
        known = self._points[:, : self._count]
        at = np.searchsorted(known[0], before, side="right") - 1
        places, radii = (np.interp(before, known[0], known[row]) for row in (1, 2))
        below = np.array([places, radii, known[3, at]])
        older, neighbour, radius = below[:, 1:], float(places[0]), float(radii[0])
        beside = z - neighbour
        if abs(beside) < self._diameter and self._beside(z, radius, older):
            aside = neighbour + math.copysign(self._diameter, beside)
            room = abs(aside - self.within(aside)) <= _GIVES * self._diameter
            aside = self.within(aside)
            slides = room and abs(beside) >= _SLIDES * self._diameter
            if slides and self._beside(aside, radius, older):
                return self._on(aside, older)
        return self._on(z, below)

    def _beside(self, z: float, radius: float, older: FloatArray) -> bool:
        """Return whether cable would come down at z [m] beside the turn before at a radius [m]."""
        return self._on(z, older).radius < radius + _LEVEL * self._diameter

    def _on(self, z: float, below: FloatArray) -> Rest:
        """Return how cable lies at z [m] on cable: rows z, radius, layer, shape (3, n)."""
        d = self._diameter
        touched = below[:, np.abs(z - below[0]) < (1.0 - _GIVES) * d]
        if not touched.shape[1]:
            return Rest(z, self._bare, 1)
        heights = touched[1] + contact_height(d, z - touched[0])
        highest = float(heights.max())
        bearing = touched[2, heights > highest - _BEARS * d]
        return Rest(z, max(highest, self._bare), int(bearing.max()) + 1)
