"""Bands that lie between two neighbours: a spacing that is told too large gives them no number."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.detection.band import Band
from marker_tracker_node.detection.gate import Gates, empty_gates
from marker_tracker_node.tracking.gate_prediction import predict_gate
from marker_tracker_node.tracking.state import PATH_STEP, Marks, Setup

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
        setup: Setup,
        marks: Marks,
        path: FloatArray,
        turned: float,
    ) -> None:
        """Look at a frame.

        Args:
            frame: Shape (rows, columns, 3).
            table: Colours of the markers, see `Picture`.
            setup: Machine and camera.
            marks: What is known of the markers.
            path: See `Tracks`.
            turned: Cylinder angle as the camera sees it [rad].
        """
        known = marks.theta[marks.known]
        # A gap is known once its second marker has landed, and looked at in the laps after that.
        widest = float(np.diff(known).max()) if known.size > 1 else 0.0
        laps = math.floor(min(turned, widest + _TURN * (_LOOKS + 3)) / _TURN)
        for lap in range(1 + max(laps, -1)):
            place = math.floor((turned - _TURN * lap - _AHEAD) / _GRID)
            looked = self._looked.setdefault(lap, set())
            if place < 0 or place in looked or self._looks.get(place, 0) == _LOOKS:
                continue
            theta = place * _GRID
            n = _marker_before(marks, theta)
            if n is None:
                continue
            looked.add(place)
            self._looks[place] = self._looks.get(place, 0) + 1
            band = _band(marks, path, n, theta, turned - theta)
            if _beside_another(setup, marks, theta, band.z):
                continue
            self._places.setdefault(n, set()).add(place)
            least, most = _AREA
            if least <= _filled(frame, table, setup, band) <= most:
                self._there.setdefault((n, place), set()).add(lap)


def _marker_before(marks: Marks, theta: float) -> int | None:
    """Return the marker before a wound angle [rad] whose neighbour behind it is known, too."""
    for n in range(marks.known.size - 1):
        known = marks.known[n] and marks.known[n + 1]
        if known and marks.theta[n] + _BESIDE < theta < marks.theta[n + 1] - _BESIDE:
            return n
    return None


def _beside_another(setup: Setup, marks: Marks, theta: float, z: float) -> bool:
    """Return whether a known marker lies so near a place [rad, m] that it would be taken for it."""
    away = np.remainder(marks.theta - theta + math.pi, _TURN) - math.pi
    reach = 2.0 * _WIDER * setup.body.cable_radius + setup.across_margin
    near = (np.abs(away) < _BESIDE) & (np.abs(marks.height - z) < reach)
    return bool((near & marks.known).any())


def _band(marks: Marks, path: FloatArray, n: int, theta: float, azimuth: float) -> Band:
    """Return the band that would lie at a wound angle [rad] between marker n and the next."""
    first, last = marks.theta[n : n + 2].tolist()
    share = (theta - first) / (last - first)
    off = [float(marks.height[n + k]) - _path_at(path, end) for k, end in enumerate((first, last))]
    here = _path_at(path, theta)
    slope = (_path_at(path, theta + PATH_STEP) - here) / PATH_STEP
    return Band(azimuth, here + off[0] + share * (off[1] - off[0]), slope)


def _path_at(path: FloatArray, theta: float) -> float:
    """Return the expected z [m] of the laid cable at a wound angle [rad]."""
    place = min(max(theta / PATH_STEP, 0.0), path.size - 2.0)
    k = int(place)
    return float(path[k] + (place - k) * (path[k + 1] - path[k]))


def _filled(frame: ByteArray, table: ByteArray, setup: Setup, band: Band) -> float:
    """Return the share of a band's expected area that has the markers' colour; nan outside."""
    gates = empty_gates(1)
    expected = predict_gate(setup, band, gates, 0)
    gates.ahead[0] *= _ROOM
    gates.behind[0] *= _ROOM
    gates.left[0] *= _WIDER
    gates.right[0] *= _WIDER
    inside = _inside(gates, frame.shape[0], frame.shape[1])
    if inside is None or not expected > 0.0:
        return math.nan
    rows, columns = inside
    coarse = frame[rows, columns].astype(np.uint32) >> 3
    marked = table[(coarse[:, 0] << 10) | (coarse[:, 1] << 5) | coarse[:, 2]].sum()
    return float(_COARSE**2 * marked / expected)


def _inside(
    gates: Gates, height: int, width: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]] | None:
    """Return rows and columns of the pixels in the gate; None where it leaves the picture."""
    u, v = float(gates.along_u[0]), float(gates.along_v[0])
    length = max(float(gates.ahead[0]), float(gates.behind[0]))
    breadth = max(-float(gates.left[0]), float(gates.right[0]))
    column, row = float(gates.column[0]), float(gates.row[0])
    if not (0.0 <= row < height and 0.0 <= column < width):
        return None
    wide, high = length * abs(u) + breadth * abs(v), length * abs(v) + breadth * abs(u)
    top, bottom = max(math.floor(row - high), 0), min(math.ceil(row + high), height - 1)
    left, right = max(math.floor(column - wide), 0), min(math.ceil(column + wide), width - 1)
    rows, columns = np.mgrid[top : bottom + 1 : _COARSE, left : right + 1 : _COARSE]
    du, dv = columns - column, rows - row
    along, across = du * u + dv * v, u * dv - v * du
    within = (along >= -gates.behind[0]) & (along <= gates.ahead[0])
    within &= (across >= gates.left[0]) & (across <= gates.right[0])
    return rows[within], columns[within]
