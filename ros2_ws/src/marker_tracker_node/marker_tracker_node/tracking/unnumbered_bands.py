"""Bands that lie between two neighbours: a spacing that is told too large gives them no number."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.detection.band import Band
from marker_tracker_node.detection.gate import empty_gates, in_gate, table_index
from marker_tracker_node.tracking.gate_prediction import predict_gate
from marker_tracker_node.tracking.state import PATH_STEP, FlagArray, Setup
from marker_tracker_node.tracking.tracker_state import TrackerState, setup_of
from winding_core.compiling import called, compiled

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]

_TURN = 2.0 * math.pi
# Wound angle between the places that are looked at [rad], each once a turn: as long as the range
# of azimuths in which that happens, so that no place is left out.
_GRID = 0.17
_AHEAD = 0.03
# Nearer to a marker than this its own band would be taken for another [rad].
_BESIDE = 0.9
# The gate is so many times as long, and as wide, as that of a band whose place is known.
_ROOM, _WIDER = 2.5, 1.7
# Every so many rows and columns are enough to tell a band by its area.
_COARSE = 2
# Share of the expected area that a band fills.
_AREA = (0.5, 1.5)
# A band is believed when it was there in so many laps, and most of the gap is without one:
# something yellow in front of the cylinder is there wherever one looks.
_LAPS, _MOST_OF_GAP = 2, 0.3
# A place is looked at in so many laps.
_LOOKS = 3


class UnnumberedBands:
    """Looks at the cable between known neighbours while it passes before the camera."""

    def __init__(self) -> None:
        self._looked: dict[int, set[int]] = {}
        self._looks: dict[int, int] = {}
        self._there: dict[tuple[int, int], set[int]] = {}
        self._places: dict[int, set[int]] = {}

    @property
    def found(self) -> tuple[int, ...]:
        """Numbers of the markers after which such a band lies."""
        markers = []
        for n, looked in self._places.items():
            there = {place for number, place in self._there if number == n}
            if len(there) > max(_MOST_OF_GAP * len(looked), 3):
                continue
            nothing: set[int] = set()
            if any(
                len(self._there[n, place] | self._there.get((n, place + 1), nothing)) >= _LAPS
                for place in there
            ):
                markers.append(n)
        return tuple(sorted(markers))

    def look(
        self,
        frame: ByteArray,
        table: ByteArray,
        fixed: FloatArray,
        state: TrackerState,
        turned: float,
    ) -> None:
        """Look at a frame.

        Args:
            frame: Shape (rows, columns, 3).
            table: Colours of the markers, see `Picture`.
            fixed: See `setup_numbers`.
            state: Of the tracker.
            turned: Cylinder angle as the camera sees it [rad].
        """
        known = state.marks[0][state.known]
        # A gap is known once its second marker has landed, and looked at in the laps after that.
        widest = max(np.diff(known).tolist(), default=0.0)
        laps = math.floor(min(turned, widest + _TURN * (_LOOKS + 3)) / _TURN)
        for lap in range(1 + max(laps, -1)):
            place = math.floor((turned - _TURN * lap - _AHEAD) / _GRID)
            looked = self._looked.setdefault(lap, set())
            if place < 0 or place in looked or self._looks.get(place, 0) == _LOOKS:
                continue
            theta = place * _GRID
            n, share = _band_share(
                frame, table, fixed, state.known, state.marks, state.path, theta, turned - theta
            )
            if n < 0:
                continue
            looked.add(place)
            self._looks[place] = self._looks.get(place, 0) + 1
            if math.isinf(share):
                continue
            self._places.setdefault(n, set()).add(place)
            least, most = _AREA
            if least <= share <= most:
                self._there.setdefault((n, place), set()).add(lap)


@compiled
def _band_share(
    pixels: ByteArray,
    table: ByteArray,
    fixed: FloatArray,
    known: FlagArray,
    marks: FloatArray,
    path: FloatArray,
    theta: float,
    azimuth: float,
) -> tuple[int, float]:  # pragma: no cover
    """Return the marker before a wound angle, and how much of a band there has its colour.

    Args:
        pixels: Shape (rows, columns, 3).
        table: See `Picture`.
        fixed: See `setup_numbers`, shape (36,).
        known: See `TrackerState`, shape (markers,).
        marks: See `TrackerState`, shape (8, markers).
        path: See `TrackerState` [m], shape (PATH_SIZE,).
        theta: [rad]
        azimuth: [rad]

    Returns:
        Number of the marker, or -1 where none and its neighbour behind it are known; the share of
        the area that a band there would have: nan outside of the picture, inf beside a marker.
    """
    setup, angles, heights = setup_of(fixed), marks[0], marks[1]
    n = _marker_before(known, angles, theta)
    if n < 0:
        return n, math.nan
    share = (theta - angles[n]) / (angles[n + 1] - angles[n])
    first = heights[n] - _path_at(path, angles[n])
    second = heights[n + 1] - _path_at(path, angles[n + 1])
    here = _path_at(path, theta)
    slope = (_path_at(path, theta + PATH_STEP) - here) / PATH_STEP
    z = here + first + share * (second - first)
    reach = 2.0 * _WIDER * setup.body.cable_radius + setup.across_margin
    for m in range(known.size):
        away = angles[m] - theta
        away -= _TURN * round(away / _TURN)
        if known[m] and abs(away) < _BESIDE and abs(heights[m] - z) < reach:
            return n, math.inf
    band = Band(azimuth, z, slope, -math.pi, math.pi, math.inf, math.inf)
    return n, _filled(pixels, table, setup, band)


@called
def _marker_before(known: FlagArray, angles: FloatArray, theta: float) -> int:  # pragma: no cover
    """Return the marker before a wound angle [rad] whose neighbour behind it is known, or -1."""
    for n in range(known.size - 1):
        between = angles[n] + _BESIDE < theta < angles[n + 1] - _BESIDE
        if known[n] and known[n + 1] and between:
            return n
    return -1


@called
def _path_at(path: FloatArray, theta: float) -> float:  # pragma: no cover
    """Return the expected z [m] of the laid cable at a wound angle [rad]."""
    place = min(max(theta / PATH_STEP, 0.0), path.size - 2.0)
    k = int(place)
    return float(path[k] + (place - k) * (path[k + 1] - path[k]))


@called
def _filled(
    pixels: ByteArray, table: ByteArray, setup: Setup, band: Band
) -> float:  # pragma: no cover
    """Return the share of a band's expected area that has the markers' colour; nan outside."""
    gates = empty_gates(1)
    expected = predict_gate(setup, band, gates, 0)
    gates.ahead[0] *= _ROOM
    gates.behind[0] *= _ROOM
    gates.left[0] *= _WIDER
    gates.right[0] *= _WIDER
    height, width = pixels.shape[:2]
    u, v, column, row = gates.along_u[0], gates.along_v[0], gates.column[0], gates.row[0]
    if not (0.0 <= row < height and 0.0 <= column < width and expected > 0.0):
        return math.nan
    length, breadth = max(gates.ahead[0], gates.behind[0]), max(-gates.left[0], gates.right[0])
    wide, high = length * abs(u) + breadth * abs(v), length * abs(v) + breadth * abs(u)
    top, bottom = max(math.floor(row - high), 0), min(math.ceil(row + high), height - 1)
    left, right = max(math.floor(column - wide), 0), min(math.ceil(column + wide), width - 1)
    marked = 0
    for y in range(top, bottom + 1, _COARSE):
        for x in range(left, right + 1, _COARSE):
            if in_gate(gates, 0, float(x), float(y)):
                marked += table[table_index(pixels[y, x, 0], pixels[y, x, 1], pixels[y, x, 2])]
    return float(_COARSE * _COARSE * marked / expected)
