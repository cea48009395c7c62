"""What a run keeps so that its configured numbers can be judged by its pictures."""

from __future__ import annotations

import math

import numpy as np

from marker_tracker_node.arrays import ByteArray, FlagArray, FloatArray, IndexArray
from marker_tracker_node.detection.band import Band
from marker_tracker_node.detection.colour import Palette
from marker_tracker_node.detection.gate import (
    ANY,
    Gates,
    Picture,
    empty_gates,
    gate_moments,
    seeking,
)
from marker_tracker_node.tracking.frame.acquisition import ASTRAY
from marker_tracker_node.tracking.frame.gate_prediction import predict_gate
from marker_tracker_node.tracking.frame.laid_path import LaidCable, corrected_height, path_height
from marker_tracker_node.tracking.p0_search import WHOLE_ENOUGH
from marker_tracker_node.tracking.sighting_log import SightingLog
from marker_tracker_node.tracking.state import (
    PATH_SIZE,
    PATH_STEP,
    Burst,
    FixedNumbers,
    Rows,
    Setup,
    TrackerState,
    by_field,
    record_dtype,
    setup_of,
)
from winding_core.compiling import called, compiled

# Frames closer than this add nothing [s].
_PERIOD = 0.02

# Bands without a number. Wound angle between the places that are looked at [rad], each once a turn:
# as long as the range of azimuths in which that happens, so that no place is left out.
_GRID = 0.17
# The gate is so many times as long, and as wide, as that of a band whose place is known.
_ROOM = 1.7
# A place is looked at in so many laps; a band is believed when it was there in more than one, and
# in so much of the gap at most: something yellow in front of the cylinder is wherever one looks.
_LOOKS, _MOST_OF_GAP = 3, 0.3
# Cable is expected no farther.
_PLACES = int(PATH_SIZE * PATH_STEP / _GRID)


class Looks:
    """Of places that were looked at, arrays of shape (places, _LOOKS)."""

    lap: IndexArray  # In which that was; -1 where it was not
    number: IndexArray  # Of the marker before the place; -1 where a marker lies beside it
    there: FlagArray  # Whether a band was there


class RunEvidence:
    """Watches frames and what was made of them.

    Attributes:
        log: What was seen of the markers, lap by lap.
    """

    def __init__(self) -> None:
        self.log = SightingLog()
        self._looks = np.zeros((_PLACES, _LOOKS), dtype=record_dtype(Looks))
        self._looks["lap"] = -1
        self._looks["number"] = -1
        self._taken = -math.inf

    @property
    def unnumbered(self) -> tuple[int, ...]:
        """Numbers of the markers behind which a band has no number, as the spacing is too large."""
        looks, markers = by_field(self._looks, Looks), []
        for n in np.unique(looks.number[looks.number >= 0]).tolist():
            mine = looks.number == n
            there = mine & looks.there
            places = np.flatnonzero(there.any(axis=1))
            if len(places) > max(_MOST_OF_GAP * np.count_nonzero(mine.any(axis=1)), 3):
                continue
            both = (slice(place, place + 2) for place in places)
            if any(len(set(looks.lap[two][there[two]].tolist())) > 1 for two in both):
                markers.append(n)
        return tuple(markers)

    def take(
        self,
        frames: ByteArray,
        palette: Palette,
        fixed: FixedNumbers,
        state: TrackerState,
        readings: FloatArray,
        out: Burst,
    ) -> None:
        """Take the frames of a burst, shape (k, rows, columns, 3), and what they yielded.

        The state is that after the burst; for readings see `update_burst`.
        """
        taken = []
        for k, t in enumerate(readings[0].tolist()):
            if t - self._taken >= _PERIOD:
                self._taken = t
                taken.append(k)
        if taken:
            kept, turned = np.array(taken), out.angle + state.shift
            self.log.take(frames, kept, readings, out)
            filled = int(state.run_rows["path_filled"][0])
            _look_between(
                frames, kept, *palette, fixed, state.mark_rows, state.path, filled, turned,
                self._looks,
            )  # fmt: skip


@compiled
def _look_between(
    frames: ByteArray,
    kept: IndexArray,
    tables: ByteArray,
    colour_of: IndexArray,
    fixed: FixedNumbers,
    marks: Rows,
    path: FloatArray,
    filled: int,
    turned: FloatArray,
    looks: Rows,
) -> None:  # pragma: no cover
    """Look at the places between known neighbours that the kept ones of some frames show."""
    setup, gates, cable = setup_of(fixed), empty_gates(1), LaidCable(marks, path, filled)
    # A gap is known once its second marker has landed, and looked at in the laps after that.
    widest = 0.0
    for n in range(marks.size - 1):
        if marks[n].known and marks[n + 1].known:
            widest = max(widest, marks[n + 1].theta - marks[n].theta)
    for k in kept:
        laps = math.floor(min(turned[k], widest + math.tau * (_LOOKS + 3)) / math.tau)
        for lap in range(1 + max(laps, -1)):
            place = math.floor((turned[k] - math.tau * lap) / _GRID)
            if not 0 <= place < looks.shape[0]:
                continue
            theta = place * _GRID
            n = _marker_before(marks, theta)
            if n < 0:
                continue
            look = 0
            while look < _LOOKS and looks[place, look].lap not in (-1, lap):
                look += 1
            if look == _LOOKS or looks[place, look].lap == lap:
                continue
            looks[place, look].lap = lap
            picture = seeking(Picture(frames[k], tables, tables, colour_of), ANY)
            share = _band_share(picture, setup, cable, theta, turned[k] - theta, gates)
            if not math.isinf(share):
                looks[place, look].number = n
                looks[place, look].there = abs(share - 1.0) <= WHOLE_ENOUGH


@called
def _marker_before(marks: Rows, theta: float) -> int:  # pragma: no cover
    """Return the marker before a wound angle [rad] whose neighbour behind it is known, or -1."""
    for n in range(marks.size - 1):
        between = marks[n].theta + ASTRAY < theta < marks[n + 1].theta - ASTRAY
        if marks[n].known and marks[n + 1].known and between:
            return n
    return -1


@called
def _band_share(
    picture: Picture, setup: Setup, cable: LaidCable, theta: float, azimuth: float, gates: Gates
) -> float:  # pragma: no cover
    """Return how much of a band at a wound angle between markers has the markers' colour.

    That is in shares of its area; nan outside of the picture, inf beside a marker.
    """
    z, slope = corrected_height(cable, theta)[0], path_height(cable, theta)[1]
    reach, marks = 2.0 * _ROOM * setup.body.cable_radius + setup.across_margin, cable.marks
    for m in range(marks.known.size):
        away = marks.theta[m] - theta
        away -= math.tau * round(away / math.tau)
        if marks.known[m] and abs(away) < ASTRAY and abs(marks.height[m] - z) < reach:
            return math.inf
    band = Band(azimuth, z, slope, -math.pi, math.pi, math.inf, math.inf)
    expected = predict_gate(setup, band, gates, 0)
    for side in (gates.ahead, gates.behind, gates.left, gates.right):
        side[0] *= _ROOM
    rows, columns = picture.pixels.shape[:2]
    if not (0.0 <= gates.row[0] < rows and 0.0 <= gates.column[0] < columns and expected > 0.0):
        return math.nan
    return gate_moments(picture, gates, 0)[0] / expected
