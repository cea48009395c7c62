"""What a run keeps so that its configured numbers can be judged by its pictures."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.detection.band import Band
from marker_tracker_node.detection.gate import empty_gates, in_gate, table_index
from marker_tracker_node.tracking.frame.gate_prediction import predict_gate
from marker_tracker_node.tracking.state import (
    PATH_STEP,
    Burst,
    FixedNumbers,
    Rows,
    Setup,
    TrackerState,
    setup_of,
)
from winding_core.compiling import called, compiled
from winding_core.markers import MarkerFlag

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]

_TURN = 2.0 * math.pi
# Frames closer than this add nothing [s].
_PERIOD = 0.02

# The log of sightings.
_OCCLUDED = int(MarkerFlag.OCCLUDED)
# Rows kept; a full log drops what lies between the first and the newest quarter.
_ROWS = 16384
_QUARTER = _ROWS // 4
_COLUMNS = ("marker", "lap", "t", "angle", "azimuth")
# Of a sighting that are kept as they are in `Output`.
_AS_SEEN = ("seen_height", "slope", "low", "high", "below", "above")
# Every so many rows and columns of a picture show how bright it is.
_LIGHT_STRIDE = 16

# Bands without a number. Wound angle between the places that are looked at [rad], each once a turn:
# as long as the range of azimuths in which that happens, so that no place is left out.
_GRID = 0.17
_AHEAD = 0.03
# Nearer to a marker than this its own band would be taken for another [rad].
_BESIDE = 0.9
# The gate is so many times as long, and as wide, as that of a band whose place is known.
_ROOM, _WIDER = 2.5, 1.7
# Every so many rows and columns are enough to recognise a band by its area.
_BAND_STRIDE = 2
# Share of the expected area that a band fills.
_AREA = (0.5, 1.5)
# A band is believed when it was there in so many laps, and most of the gap is without one:
# something yellow in front of the cylinder is there wherever one looks.
_LAPS, _MOST_OF_GAP = 2, 0.3
# A place is looked at in so many laps.
_LOOKS = 3


@dataclass
class Lap:
    """One passing of a marker before the camera."""

    measured: int = 0  # Frames that measured the marker
    missed: int = 0  # Frames that had it in sight and did not find it
    light: float = 0.0  # Sum of their mean grey levels

    @property
    def frames(self) -> int:
        """Frames that had the marker in sight."""
        return self.measured + self.missed


class SightingLog:
    """Takes what frames yielded.

    Attributes:
        laps: By marker and lap; the laps of a marker are counted by its azimuth.
    """

    def __init__(self) -> None:
        self.laps: dict[tuple[int, int], Lap] = {}
        self._rows = _Table((*_COLUMNS, *_AS_SEEN))
        self._motion = _Table(("t", "angle"))

    @property
    def sightings(self) -> FloatArray:
        """Measured bands, see `Seen.rows`, shape (n, 11)."""
        return self._rows.values

    @property
    def motion(self) -> FloatArray:
        """The cylinder as the encoder reported it, shape (n, 2): t [s], angle [rad]."""
        return self._motion.values

    def add(self, frame: ByteArray, t: float, reading: float, out: Burst, k: int) -> None:
        """Take a frame.

        Args:
            frame: Shape (rows, columns, 3).
            t: [s]
            reading: Of the encoder [rad], nan where missing.
            out: What frames yielded.
            k: Which of them this one is.
        """
        if math.isnan(reading):
            return
        angle = float(out.angle[k])
        self._motion.add((t, angle))
        light: float | None = None
        rows = out.rows[k]
        wound, flags = rows["theta"].tolist(), rows["marker_flags"].tolist()
        for n, measured in enumerate(rows["azimuth"].tolist()):
            seen, azimuth = not math.isnan(measured), measured
            if not seen:
                if not flags[n] & _OCCLUDED:
                    continue
                azimuth = angle - wound[n]
            number = round(azimuth / _TURN)
            lap = self.laps.setdefault((n, number), Lap())
            if light is None:
                shown = frame[::_LIGHT_STRIDE, ::_LIGHT_STRIDE]
                light = int(shown.sum()) / shown.size
            lap.light += light
            if seen:
                lap.measured += 1
                rest = (float(rows[name][n]) for name in _AS_SEEN)
                self._rows.add((n, number, t, angle, azimuth - _TURN * number, *rest))
            else:
                lap.missed += 1


class _Table:
    """Rows of numbers: the first of a run and the newest."""

    def __init__(self, columns: tuple[str, ...]) -> None:
        self._values = np.zeros((_ROWS, len(columns)))
        self._count = 0

    @property
    def values(self) -> FloatArray:
        """The rows, as a view."""
        return self._values[: self._count]

    def add(self, row: tuple[float, ...]) -> None:
        """Take a row."""
        if self._count == _ROWS:
            self._values[_QUARTER : 2 * _QUARTER] = self._values[-_QUARTER:]
            self._count = 2 * _QUARTER
        self._values[self._count] = row
        self._count += 1


class UnnumberedBands:
    """Looks for bands between known neighbours: with too large a spacing they get no number."""

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
        fixed: FixedNumbers,
        state: TrackerState,
        turned: float,
    ) -> None:
        """Look at a frame.

        Args:
            frame: Shape (rows, columns, 3).
            table: Colours of the markers, see `Picture`.
            fixed: See `fixed_numbers`.
            state: Of the tracker.
            turned: Cylinder angle as the camera sees it [rad].
        """
        marks = state.mark_rows
        wound, known = marks["theta"].tolist(), marks["known"].tolist()
        pairs = zip(wound, wound[1:], known, known[1:], strict=False)
        gaps = [(first, last) for first, last, *both in pairs if all(both)]
        # A gap is known once its second marker has landed, and looked at in the laps after that.
        widest = max((last - first for first, last in gaps), default=0.0)
        laps = math.floor(min(turned, widest + _TURN * (_LOOKS + 3)) / _TURN)
        for lap in range(1 + max(laps, -1)):
            place = math.floor((turned - _TURN * lap - _AHEAD) / _GRID)
            looked = self._looked.setdefault(lap, set())
            if place < 0 or place in looked or self._looks.get(place, 0) == _LOOKS:
                continue
            theta = place * _GRID
            if not any(first + _BESIDE < theta < last - _BESIDE for first, last in gaps):
                continue
            n, share = _band_share(frame, table, fixed, marks, state.path, theta, turned - theta)
            looked.add(place)
            self._looks[place] = self._looks.get(place, 0) + 1
            if math.isinf(share):
                continue
            self._places.setdefault(n, set()).add(place)
            least, most = _AREA
            if least <= share <= most:
                self._there.setdefault((n, place), set()).add(lap)


class RunEvidence:
    """Watches frames and what was made of them.

    Attributes:
        log: What was seen of the markers, lap by lap.
        unnumbered: What lies between them.
    """

    def __init__(self) -> None:
        self.log = SightingLog()
        self.unnumbered = UnnumberedBands()
        self._taken = -math.inf

    def take(
        self,
        frames: ByteArray,
        table: ByteArray,
        fixed: FixedNumbers,
        state: TrackerState,
        readings: FloatArray,
        out: Burst,
    ) -> None:
        """Take the frames of a burst.

        Args:
            frames: Shape (k, rows, columns, 3).
            table: Colours of the markers, see `Picture`.
            fixed: See `fixed_numbers`.
            state: After the burst.
            readings: See `update_burst`.
            out: What the frames yielded.
        """
        for k, t in enumerate(readings[0].tolist()):
            if t - self._taken < _PERIOD:
                continue
            self._taken = t
            self.log.add(frames[k], t, float(readings[1, k]), out, k)
            turned = float(out.angle[k]) + state.shift
            self.unnumbered.look(frames[k], table, fixed, state, turned)


@compiled
def _band_share(
    pixels: ByteArray,
    table: ByteArray,
    fixed: FixedNumbers,
    marks: Rows,
    path: FloatArray,
    theta: float,
    azimuth: float,
) -> tuple[int, float]:  # pragma: no cover
    """Return the marker before a wound angle, and how much of a band there has its colour.

    Args:
        pixels: Shape (rows, columns, 3).
        table: See `Picture`.
        fixed: See `fixed_numbers`.
        marks: Of MARK, shape (markers,).
        path: See `TrackerState` [m], shape (PATH_SIZE,).
        theta: [rad]
        azimuth: [rad]

    Returns:
        Number of the marker, or -1 where none and its neighbour behind it are known; the share of
        the area that a band there would have: nan outside of the picture, inf beside a marker.
    """
    setup = setup_of(fixed)
    n = _marker_before(marks, theta)
    if n < 0:
        return n, math.nan
    before, behind = marks[n], marks[n + 1]
    share = (theta - before.theta) / (behind.theta - before.theta)
    first = before.height - _path_at(path, before.theta)
    second = behind.height - _path_at(path, behind.theta)
    here = _path_at(path, theta)
    slope = (_path_at(path, theta + PATH_STEP) - here) / PATH_STEP
    z = here + first + share * (second - first)
    reach = 2.0 * _WIDER * setup.body.cable_radius + setup.across_margin
    for m in range(marks.size):
        away = marks[m].theta - theta
        away -= _TURN * round(away / _TURN)
        if marks[m].known and abs(away) < _BESIDE and abs(marks[m].height - z) < reach:
            return n, math.inf
    band = Band(azimuth, z, slope, -math.pi, math.pi, math.inf, math.inf)
    return n, _filled(pixels, table, setup, band)


@called
def _marker_before(marks: Rows, theta: float) -> int:  # pragma: no cover
    """Return the marker before a wound angle [rad] whose neighbour behind it is known, or -1."""
    for n in range(marks.size - 1):
        between = marks[n].theta + _BESIDE < theta < marks[n + 1].theta - _BESIDE
        if marks[n].known and marks[n + 1].known and between:
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
    for y in range(top, bottom + 1, _BAND_STRIDE):
        for x in range(left, right + 1, _BAND_STRIDE):
            if in_gate(gates, 0, float(x), float(y)):
                marked += table[table_index(pixels[y, x, 0], pixels[y, x, 1], pixels[y, x, 2])]
    return float(_BAND_STRIDE * _BAND_STRIDE * marked / expected)
