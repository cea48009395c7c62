"""The surface that the next turns lie on: cable on the cylinder, by its place there."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.compile import called, kernel
from cable_fem_node.dynamics.contact_springs import springs
from cable_fem_node.dynamics.state import (
    BELOW_HEIGHT,
    BELOW_ROWS,
    MOST_BELOW,
    FloatArray,
    IntArray,
    empty_points,
    penalty,
)

TURN = 2.0 * math.pi
LINES = 128  # Lines along the cylinder that the cable's crossings are kept of
# Columns of a crossing: wound angle, place, radius, how both go with the angle, and number of the
# integrated element, -1 of cable at rest.
_THETA, _Z, _RADIUS, _SLOPE, _RISE, _ELEMENT = range(6)
# In distances of touching centre lines: how far cable is sought, the gap to cable that a node may
# come to lie on before the next look, the least gap of all nodes with which any of that matters,
# and how far then a node may move across the cable, and the cable over the surface, which shifts
# what lies below by its lean.
_SOUGHT, _REACH, _NEAR, _KEPT, _WAY = 1.0, 0.3, 0.03, 0.15, 0.1


class CableBelow(NamedTuple):
    """Which cable nodes may lie on, and until when."""

    below: FloatArray  # See `Points.below`, shape (BELOW_HEIGHT, n); (0, n) where none is near
    room: FloatArray  # In which nodes may lie on no other, see `RodState`, shape (3, n)
    way: float  # Over the surface, the same [m]


# Before a full turn cable is sought below what has been wound, in distances of centre lines.
AHEAD = 2.0 + _SOUGHT


class _Map(NamedTuple):
    """Crossings of the cable with lines along the cylinder, and the cells they lie in."""

    cell: float  # Width of a cell [m]
    first: int  # Number of the cell that the map begins with
    top: IntArray  # Last crossing of each cell, -1 for none, shape (LINES, cells)
    crossings: FloatArray  # Columns _THETA .. _ELEMENT, shape (room, 6)
    before: IntArray  # Crossing that was its cell's last before it, shape (room,)


class WoundSurface:
    """Crossings of the cable with lines along the cylinder, in cells of half its width.

    In each cell the last crossing refers to that before it, which it may cover and which comes to
    light where it is taken off.

    Args:
        apart: Distance of the centre lines of cable that lies on cable [m].
    """

    def __init__(self, apart: float) -> None:
        self._apart = apart
        top, before = np.full((LINES, 16), -1, dtype=np.int64), np.zeros(256, dtype=np.int64)
        self._map = _Map(0.5 * apart, 0, top, np.zeros((256, 6)), before)
        self._count = 0
        self._highest = 0.0  # Radius of the centre line of any cable so far [m]

    def compile(self) -> None:
        """Load or build the machine code of what a look needs."""
        path = np.array([[0.0, 0.1], [0.0, 0.0], [1.0, 1.0]])
        trial = WoundSurface(self._apart)
        trial.lay(path)
        trial.below(path, np.zeros(2), np.ones(2, dtype=bool))
        trial.lift(0.0)
        reach(unrolled(0.0, np.ones((3, 4))[:, :2]), 1, self._apart)
        points = empty_points(2)._replace(below=np.zeros((BELOW_HEIGHT, 2)))
        springs(points, penalty(1.0, 1.0, friction=0.0, stick_share=1.0), 2, 0.0)

    def lay(self, path: FloatArray, rests: bool = True) -> None:
        """Add cable.

        Args:
            path: Wound angles of its nodes [rad], ascending, the node before them first; z [m];
                radius of the centre line [m]; shape (3, n).
            rests: Whether it rests; what does not gives way, but for its first element.
        """
        element = -path.shape[1] - 1 if rests else 0
        if not self._count:
            # The end of the cable is sought from before it on.
            end = path[:, :1].copy()
            end[0] -= (1.0 + _SOUGHT) * self._apart / end[2] + TURN / LINES
            path, element = np.concatenate([end, path], axis=1), element - 1
        self._highest = max(self._highest, float(path[2].max()))
        self._make_room(float(path[1].min()), float(path[1].max()))
        more = int((path[0, -1] - path[0, 0]) / TURN * LINES) + 2
        if self._count + more > len(self._map.before):
            room = 2 * (self._count + more)
            self._map = self._map._replace(
                crossings=np.resize(self._map.crossings, (room, 6)),
                before=np.resize(self._map.before, room),
            )
        self._count = _lay(path, element, self._map, self._count)

    def lift(self, theta: float) -> None:
        """Take off what was laid beyond a wound angle [rad]."""
        self._count = _lift(theta, self._map, self._count)

    def below(self, path: FloatArray, lower: FloatArray, free: NDArray[np.bool_]) -> CableBelow:
        """Return the centre lines that nodes may lie on, see `Points.below`.

        Args:
            path: Wound angles [rad], z [m] and radii [m] of the nodes, shape (3, n).
            lower: By how much their centre line is lower [m], shape (n,).
            free: Which of them do not turn with the surface, shape (n,).
        """
        n = path.shape[1]
        out, room = np.zeros((BELOW_HEIGHT, n)), np.empty((3, n))
        near, way = _below(path, lower, free, self._apart, self._highest, self._map, out, room)
        return CableBelow(out if near else out[:0], room, way)

    def _make_room(self, low: float, high: float) -> None:
        cell, known, top, *_ = self._map
        first, last = math.floor(low / cell), math.floor(high / cell)
        cells = top.shape[1]
        if known <= first and last < known + cells:
            return
        begin, end = min(known, first - cells), max(known + cells, last + cells)
        wider = np.full((LINES, end - begin), -1, dtype=np.int64)
        wider[:, known - begin : known - begin + cells] = top
        self._map = self._map._replace(first=begin, top=wider)


@kernel
def unrolled(theta: float, position: FloatArray) -> FloatArray:
    """Return wound angle [rad], z [m] and radius [m] of nodes, shape (3, n).

    Args:
        theta: Wound angle of the first [rad]; along the cable it falls behind in azimuth.
        position: Of the nodes [m], shape (3, n).
    """
    path = np.empty_like(position)
    x, y = position[0, 0], position[1, 0]
    for i in range(position.shape[1]):
        u, v = position[0, i], position[1, i]
        theta += math.atan2(y * u - x * v, x * u + y * v)
        path[0, i], path[1, i], path[2, i] = theta, position[2, i], math.sqrt(u * u + v * v)
        x, y = u, v
    return path


@kernel
def reach(path: FloatArray, laid: int, above: float) -> tuple[float, float]:
    """Return the greatest wound angles of nodes and of those not far above the laid ones [rad].

    Args:
        path: See `unrolled`.
        laid: How many nodes are laid.
        above: How far is far [m].
    """
    over, farthest, low = path[2, :laid].max() + above, path[0, 0], path[0, 0]
    for i in range(path.shape[1]):
        farthest = max(farthest, path[0, i])
        if path[2, i] < over:
            low = max(low, path[0, i])
    return farthest, low


@kernel
def _lay(path: FloatArray, element: int, known: _Map, count: int) -> int:
    """Write the crossings of cable with the lines; return how many there are."""
    crossings, top, step = known.crossings, known.top, TURN / LINES
    theta, z, radius = path
    for i in range(1, theta.size):
        way = theta[i] - theta[i - 1]
        if not way > 0.0:
            continue
        line = math.floor(theta[i - 1] / step) + 1
        slope, rise = (z[i] - z[i - 1]) / way, (radius[i] - radius[i - 1]) / way
        while line * step <= theta[i]:
            share = (line * step - theta[i - 1]) / way
            at = z[i - 1] + share * (z[i] - z[i - 1])
            crossings[count, _THETA] = line * step
            crossings[count, _Z] = at
            crossings[count, _RADIUS] = radius[i - 1] + share * (radius[i] - radius[i - 1])
            crossings[count, _SLOPE], crossings[count, _RISE] = slope, rise
            number = element + i - 1
            crossings[count, _ELEMENT] = number if number > 0 else -1
            column, row = math.floor(at / known.cell) - known.first, line % LINES
            known.before[count] = top[row, column]
            top[row, column] = count
            count += 1
            line += 1
    return count


@kernel
def _lift(theta: float, known: _Map, count: int) -> int:
    """Take off the crossings beyond a wound angle [rad]; return how many are left."""
    crossings, step = known.crossings, TURN / LINES
    while count > 0 and crossings[count - 1, _THETA] > theta:
        count -= 1
        row = int(round(crossings[count, _THETA] / step)) % LINES  # noqa: RUF046
        column = math.floor(crossings[count, _Z] / known.cell) - known.first
        known.top[row, column] = known.before[count]
    return count


@kernel
def _below(
    path: FloatArray,
    lower: FloatArray,
    free: NDArray[np.bool_],
    apart: float,
    highest: float,
    known: _Map,
    out: FloatArray,
    room: FloatArray,
) -> tuple[bool, float]:
    """Write the nearest centre lines and the room of every node; see `CableBelow`.

    Returns:
        whether any is near, and the way.
    """
    cell, first, top, crossings, before = known
    step, cells, reach = TURN / LINES, top.shape[1], (1.0 + _SOUGHT) * apart
    gaps = np.zeros(MOST_BELOW)
    theta, z = path[0], path[1]
    n = theta.size
    centre, least = path.copy(), np.empty(n)
    centre[2] -= lower
    over = highest + apart + max(lower.max(), 0.0)
    nearest, way = _SOUGHT * apart, _SOUGHT * apart
    for i in range(n):
        line = int(round(theta[i] / step))  # noqa: RUF046
        row = line % LINES
        gaps[:], least[i] = _REACH * apart, _SOUGHT * apart
        low, high = math.floor((z[i] - reach) / cell), math.floor((z[i] + reach) / cell)
        for column in range(max(low - first, 0), min(high - first, cells - 1) + 1):
            k = top[row, column]
            while k >= 0 and crossings[k, _RADIUS] > centre[2, i] - reach:
                # Not the cable's own neighbourhood.
                if theta[i] - crossings[k, _THETA] >= 0.5 * TURN:
                    ahead = theta[i] - line * step
                    gap = _note(i, ahead, centre, apart, crossings[k], gaps, out)
                    least[i] = min(least[i], gap)
                k = before[k]
        nearest = min(nearest, least[i])
        if free[i] and path[2, i] <= over:
            way = min(way, least[i])
    near = nearest <= _NEAR * apart
    for i in range(n):
        gap = _KEPT * apart if near else least[i]
        # What lands comes down rather than aside: 0.9^2 + 0.4^2 < 1.
        room[0, i] = max(path[2, i] - 0.9 * gap, 0.0)
        room[1, i], room[2, i] = z[i] - 0.4 * gap, z[i] + 0.4 * gap
        if path[2, i] > over:
            # Above all cable there is none to lie on.
            room[0, i], room[1, i], room[2, i] = over, -math.inf, math.inf
        room[0, i] *= room[0, i]
    return near, max(_WAY * apart, 0.0 if near else way)


@called
def _note(
    i: int,
    ahead: float,
    path: FloatArray,
    apart: float,
    crossing: FloatArray,
    gaps: FloatArray,
    out: FloatArray,
) -> float:
    """Write a crossing into the column of node i if it is near; return its gap [m].

    Args:
        i: Number of the node.
        ahead: Wound angle by which it is beyond the line [rad].
        path: Wound angles [rad], z and radii [m] of the nodes.
        apart: Distance of touching centre lines [m].
        crossing: As _THETA .. _ELEMENT.
        gaps: Within reach, to the nearest so far [m], ascending, changed.
        out: See `Points.below`, changed.
    """
    slope, rise = crossing[_SLOPE], crossing[_RISE]
    at, there = crossing[_RADIUS] + rise * ahead, crossing[_Z] + slope * ahead
    up, aside = path[2, i] - at, path[1, i] - there
    along = (up * rise + aside * slope) ** 2 / (at * at + rise * rise + slope * slope)
    # The end of the cable is round.
    beyond = min(crossing[_THETA] + ahead, 0.0) * at
    # Zero would be none at all.
    distance = math.sqrt(max(apart * apart - beyond * beyond, 1.0e-12 * apart * apart))
    gap = math.sqrt(up * up + aside * aside - along + beyond * beyond) - apart
    to = MOST_BELOW
    while to > 0 and gap < gaps[to - 1]:
        to -= 1
    if to == MOST_BELOW:
        return gap
    for other in range(MOST_BELOW - 1, to, -1):
        gaps[other] = gaps[other - 1]
        for r in range(BELOW_ROWS):
            out[BELOW_ROWS * other + r, i] = out[BELOW_ROWS * (other - 1) + r, i]
    gaps[to], to = gap, BELOW_ROWS * to
    out[to, i], out[to + 1, i], out[to + 2, i], out[to + 3, i] = at, there, rise, slope
    out[to + 4, i], out[to + 5, i], out[to + 6, i] = distance, crossing[_ELEMENT], 0.0
    out[to + 8, i] = 1.0 / (at * at + rise * rise + slope * slope)
    element = int(crossing[_ELEMENT])
    if element >= 0:
        begin = path[0, element]
        out[to + 6, i] = (crossing[_THETA] + ahead - begin) / (path[0, element + 1] - begin)
    return gap
