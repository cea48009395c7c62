"""What a run has seen of its markers, lap by lap, in bounded memory."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.tracking.state import Output
from winding_core.markers import MarkerFlag

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]

_TURN = 2.0 * math.pi
_OCCLUDED = int(MarkerFlag.OCCLUDED)
# Rows kept; a full log drops what lies between the first and the newest quarter.
_ROWS = 16384
_QUARTER = _ROWS // 4
_COLUMNS = ("marker", "lap", "t", "angle", "azimuth")
# Every so many rows and columns of a picture tell how bright it is.
_COARSE = 16


@dataclass
class Lap:
    """One passing of a marker before the camera.

    Attributes:
        measured: Frames that measured the marker.
        missed: Frames that had it in sight and did not find it.
        light: Sum of their mean grey levels.
    """

    measured: int = 0
    missed: int = 0
    light: float = 0.0

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
        self._rows = _Table(_COLUMNS)
        self._motion = _Table(("t", "angle"))

    @property
    def sightings(self) -> FloatArray:
        """Measured bands, shape (n, 5): marker, lap, t [s], told angle [rad], azimuth [rad]."""
        return self._rows.values

    @property
    def motion(self) -> FloatArray:
        """What was told of the cylinder, shape (n, 2): t [s], angle [rad]."""
        return self._motion.values

    def add(self, frame: ByteArray, t: float, told: float, out: Output, k: int) -> None:
        """Take a frame.

        Args:
            frame: Shape (rows, columns, 3).
            t: [s]
            told: Encoder reading [rad], nan where missing.
            out: What frames yielded.
            k: Which of them this one is.
        """
        if math.isnan(told):
            return
        angle = float(out.angle[k])
        self._motion.add((t, angle))
        light: float | None = None
        wound, flags = out.theta[k].tolist(), out.flags[k].tolist()
        for n, measured in enumerate(out.azimuth[k].tolist()):
            seen, azimuth = not math.isnan(measured), measured
            if not seen:
                if not flags[n] & _OCCLUDED:
                    continue
                azimuth = angle - wound[n]
            number = round(azimuth / _TURN)
            lap = self.laps.setdefault((n, number), Lap())
            if light is None:
                light = float(frame[::_COARSE, ::_COARSE].mean())
            lap.light += light
            if seen:
                lap.measured += 1
                self._rows.add((n, number, t, angle, azimuth - _TURN * number))
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
