"""What a run keeps so that its told numbers can be judged by its pictures."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.tracking.consistency import contradictions
from marker_tracker_node.tracking.contradiction import Contradiction, Evidence
from marker_tracker_node.tracking.geometry_signature import signatures
from marker_tracker_node.tracking.sighting_log import SightingLog
from marker_tracker_node.tracking.state import Output, Setup
from marker_tracker_node.tracking.tracker_state import TrackerState
from marker_tracker_node.tracking.unnumbered_bands import UnnumberedBands

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]

# Frames closer than this tell nothing more [s].
_PERIOD = 0.02


class RunEvidence:
    """Watches frames and what was made of them; judges once a lap of any marker."""

    def __init__(self) -> None:
        self._log = SightingLog()
        self._unnumbered = UnnumberedBands()
        self._taken = -math.inf
        self._judged: tuple[int, tuple[Contradiction, ...]] = (0, ())

    def take(
        self,
        frames: ByteArray,
        table: ByteArray,
        fixed: FloatArray,
        state: TrackerState,
        readings: FloatArray,
        out: Output,
    ) -> None:
        """Take the frames of a burst.

        Args:
            frames: Shape (k, rows, columns, 3).
            table: Colours of the markers, see `Picture`.
            fixed: See `setup_numbers`.
            state: After the burst.
            readings: See `update_burst`.
            out: What the frames yielded.
        """
        for k, t in enumerate(readings[0].tolist()):
            if t - self._taken < _PERIOD:
                continue
            self._taken = t
            self._log.add(frames[k], t, float(readings[1, k]), out, k)
            turned = float(out.angle[k]) + state.shift
            self._unnumbered.look(frames[k], table, fixed, state, turned)

    def judged(self, setup: Setup, state: TrackerState) -> tuple[Contradiction, ...]:
        """Return which told numbers the pictures speak against."""
        laps = len(self._log.laps)
        if self._judged[0] == laps:
            return self._judged[1]
        marks = state.tracks.marks
        known = np.flatnonzero(marks.known)
        apart = np.diff(marks.theta[known]) / (np.diff(known) * setup.expected_gap)
        found = contradictions(
            Evidence(
                log=self._log,
                area=marks.area[known],
                effects=signatures(setup.camera, setup.body),
                gaps=dict(zip(known[:-1].tolist(), apart.tolist(), strict=True)),
                known=tuple(known[known > 0].tolist()),
                between=self._unnumbered.found,
            )
        )
        self._judged = laps, found
        return found
