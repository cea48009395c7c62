"""The log of a run's sightings: where markers were seen lap by lap, and how often they were not."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from marker_tracker_node.arrays import ByteArray, FlagArray, FloatArray, IndexArray
from marker_tracker_node.tracking.encoder_history import INTERPOLATED
from marker_tracker_node.tracking.estimator.problem import ANGLE, COLUMNS
from marker_tracker_node.tracking.frame.laid_path import PROOF_ADVANCE
from marker_tracker_node.tracking.state import KEPT, Burst, Rows
from winding_core.compiling import called, compiled
from winding_core.markers import MarkerFlag

_OCCLUDED = int(MarkerFlag.OCCLUDED)
# Every so many rows and columns of a picture show how bright it is.
_LIGHT_STRIDE = 16


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

    @property
    def share(self) -> float:
        """Share of those that measured it."""
        return self.measured / max(self.frames, 1)


class SightingLog:
    """Takes what frames yielded.

    Attributes:
        laps: Of each marker, by their numbers, which are counted by its azimuth.
    """

    def __init__(self) -> None:
        self.laps: defaultdict[int, defaultdict[int, Lap]] = defaultdict(lambda: defaultdict(Lap))
        self._taken = -math.inf
        self._rows = _Table(COLUMNS)
        self._motion = _Table(2)

    @property
    def sightings(self) -> FloatArray:
        """Measured bands, see `Seen.rows`, shape (n, 12)."""
        return self._rows.values

    @property
    def motion(self) -> FloatArray:
        """The cylinder as the encoder reported it, shape (n, 2): t [s], angle [rad]."""
        return self._motion.values

    @property
    def quiet(self) -> bool:
        """Whether the pass of the last marker is over, and no other one is in sight."""
        seen, motion = self.sightings, self.motion
        return bool(len(seen)) and abs(motion[-1, 1] - seen[-1, ANGLE]) > PROOF_ADVANCE

    def forget(self, numbers: IndexArray) -> None:
        """Forget the sightings of some markers."""
        self._rows.keep(~np.isin(self._rows.values[:, 0], numbers))

    def take(self, frames: ByteArray, readings: FloatArray, out: Burst) -> None:
        """Take the frames of a burst, shape (k, rows, columns, 3), and what they yielded.

        For readings see `update_burst`; a frame without the encoder's is not taken, nor one so near
        to the last that it adds nothing.
        """
        kept = []
        for k, t in enumerate(readings[0].tolist()):
            if t - self._taken >= INTERPOLATED:
                self._taken = t
                kept.append(k)
        if not kept:
            return
        motion, passings = _passings(
            frames, np.array(kept), readings, out.angle, out.ahead, out.rows
        )
        self._motion.add(motion)
        if not len(passings):
            return
        for n, number, missed, light in passings[:, [0, 1, -2, -1]].tolist():
            lap = self.laps[int(n)][int(number)]
            lap.light += light
            if missed:
                lap.missed += 1
            else:
                lap.measured += 1
        self._rows.add(passings[passings[:, -2] == 0.0, :-2])


class _Table:
    """Rows of numbers, of some minutes: a full one keeps the first and the newest quarter."""

    def __init__(self, columns: int) -> None:
        self._values = np.zeros((KEPT, columns))
        self._count = 0

    @property
    def values(self) -> FloatArray:
        """The rows, as a view."""
        return self._values[: self._count]

    def keep(self, kept: FlagArray) -> None:
        """Keep some of the rows, shape (n,)."""
        self._count = int(kept.sum())
        self._values[: self._count] = self._values[: kept.size][kept]

    def add(self, rows: FloatArray) -> None:
        """Take rows, shape (n, columns)."""
        while len(rows):
            if self._count == KEPT:
                first, second, _, newest = np.split(self._values, 4)
                second[:] = newest
                self._count = len(first) + len(second)
            taken, rows = rows[: KEPT - self._count], rows[KEPT - self._count :]
            self._values[self._count : self._count + len(taken)] = taken
            self._count += len(taken)


@compiled
def _passings(
    frames: ByteArray,
    kept: IndexArray,
    readings: FloatArray,
    angles: FloatArray,
    ahead: FloatArray,
    rows: Rows,
) -> tuple[FloatArray, FloatArray]:  # pragma: no cover
    """Return what the kept ones of some frames show of markers that pass the camera.

    Returns:
        See `SightingLog.motion`, shape (m, 2); and `SightingLog.sightings`, then whether the
        marker was in sight and not found, and the mean grey level of the frame, shape (n, 14).
    """
    motion, count = np.empty((kept.size, 2)), 0
    found, passings = np.empty((kept.size * rows.shape[1], COLUMNS + 2)), 0
    for k in kept:
        if math.isnan(readings[1, k]):
            continue
        motion[count, 0], motion[count, 1] = readings[0, k], angles[k] - ahead[k]
        count += 1
        light = math.nan
        for n in range(rows.shape[1]):
            row, azimuth = rows[k, n], rows[k, n].azimuth
            missed = math.isnan(azimuth)
            if missed:
                if row.covered or not row.marker_flags & _OCCLUDED:
                    continue
                azimuth = angles[k] - row.theta
            if math.isnan(light):
                light = _grey_level(frames[k])
            lap = round(azimuth / math.tau)
            one = found[passings]
            one[0], one[1], one[2], one[3] = n, lap, readings[0, k], motion[count - 1, 1]
            one[4], one[5], one[6] = azimuth - math.tau * lap, row.seen_height, row.slope
            one[7], one[8], one[9], one[10] = row.low, row.high, row.below, row.above
            one[11], one[12], one[13] = row.lift, missed, light
            passings += 1
    return motion[:count], found[:passings]


@called
def _grey_level(pixels: ByteArray) -> float:  # pragma: no cover
    """Return how bright a frame of shape (rows, columns, 3) is."""
    shown = pixels[::_LIGHT_STRIDE, ::_LIGHT_STRIDE]
    total = 0
    for v in range(shown.shape[0]):
        for u in range(shown.shape[1]):
            total += shown[v, u, 0] + shown[v, u, 1] + shown[v, u, 2]
    return float(total / shown.size)
