"""Other numbers of camera, body and encoder, taken into use while a run goes on."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from marker_tracker_node.arrays import FloatArray
from marker_tracker_node.detection.band import Band
from marker_tracker_node.tracking.encoder_history import HALF_SPAN, INTERPOLATED
from marker_tracker_node.tracking.estimator.correction import Correction
from marker_tracker_node.tracking.estimator.numbers import COUNT, SCALE, TIMES
from marker_tracker_node.tracking.estimator.pictures import seen_again
from marker_tracker_node.tracking.estimator.problem import (
    ANGLE,
    AZIMUTH,
    HIGH,
    LAP,
    LOW,
    MARKER,
    TIME,
    Z,
)
from marker_tracker_node.tracking.frame.run_means import STEP
from marker_tracker_node.tracking.sighting_log import SightingLog
from marker_tracker_node.tracking.state import PATH_STEP, Marks, Rows, Setup, TrackerState
from winding_core.units import MILLIMETRE, MILLIRADIAN

# Readings of which the speed is taken, as of the encoder's own.
_SPEED_ROWS = round(2.0 * HALF_SPAN / INTERPOLATED)
_BAND = ("azimuth", "seen_height", "slope", "low", "high", "below", "above", "lift")


def turned(marks: Marks, errors: FloatArray, setups: tuple[Setup, Setup]) -> Correction:
    """Return where a turn of the camera, found in P0 alone, puts the markers.

    Errors are those of `NUMBERS`, shape (numbers,); setups that with which was measured, and the
    new one.
    """
    known = np.flatnonzero(marks.known)
    bands = np.tile(Band(0.0, 0.0, 0.0), (known.size, 1))
    bands[:, 1] = marks.height[known]
    azimuth, z, _, _ = _seen(bands, *setups).T
    return Correction(
        carried=False,
        posed=True,
        errors=errors,
        markers=known,
        theta=marks.theta[known] - azimuth + azimuth[0],
        z=z - z[0],
        doubt=np.array([marks.doubt_theta[known], marks.doubt_height[known]]),
        unexplained=known[:0],
        area=0.0,
    )


class Recalibration:
    """What is corrected of the configured numbers, and what that has changed.

    Attributes:
        begun: With which the run began; None while that is measured with.
        made: Whether anything is corrected.
        posed: Whether the camera's pose alone may explain it.
        errors: By how much each of `NUMBERS` is taken to be set too large, shape (numbers,).
        moved: By how much the azimuth of P0 has grown with the camera [rad].
        change: By how much its wound angle [rad] and z [m] from P0 have, shape (2, markers).
        ahead: How much further than reported the cylinder has turned in the last frame [rad].
        area: Logarithm of the expected area of a band over that of the configured numbers.
    """

    def __init__(self, markers: int) -> None:
        """Start with the numbers of so many markers as configured."""
        self.errors, self.change = np.zeros(COUNT), np.zeros((2, markers))
        self.moved = self.ahead = self.area = 0.0
        self.made, self.posed = False, True
        self.begun: Setup | None = None

    @property
    def remark(self) -> str:
        """What is corrected, in words; empty while nothing is."""
        turn, rise = np.abs(self.change).max(axis=1)
        return self.made * (
            f"positions are corrected by the pictures, by up to {turn / MILLIRADIAN:.1f} mrad and "
            f"{rise / MILLIMETRE:.2f} mm"
        )

    @property
    def turns(self) -> bool:
        """Whether that concerns encoder or times."""
        return bool(self.errors[[SCALE, TIMES]].any())

    def changes(self, found: Correction, marks: Marks) -> bool:
        """Return whether a correction moves a marker by enough to be made."""
        change = np.abs([found.theta, found.z] - _places(marks, found))
        if not self.made:
            return found.carried
        return bool((change > STEP * np.sqrt(found.doubt)).any())

    def turned_ahead(self, motion: FloatArray, readings: FloatArray) -> FloatArray:
        """Return how much further than reported the cylinder has turned [rad], shape (k,).

        Motion is as reported so far, times [s] and angles from the landing of P0 [rad], shape (n,
        2); readings are times of frames [s] and angles as reported [rad], shape (2, k).
        """
        t, angle = readings
        late = (t - motion[0, 0]) * self.errors[TIMES] / (1.0 + self.errors[TIMES])
        newer = readings[:, np.isfinite(angle) & (t > motion[-1, 0])]
        times, angles = np.hstack([motion.T, newer])
        few = slice(-_SPEED_ROWS, None)
        passed = float(np.ptp(times[few]))
        speed = float(angles[-1] - angles[few][0]) / passed if passed else 0.0
        turned = np.interp(t - late, times, angles) + speed * np.maximum(t - late - times[-1], 0.0)
        ahead = turned / (1.0 + self.errors[SCALE]) - angle
        return np.asarray(np.where(np.isnan(ahead), self.ahead, ahead))

    def as_begun(self, rows: Rows, setup: Setup) -> FloatArray:
        """Return azimuths [rad] and z [m] with the numbers with which the run began, shape (k, 2).

        Rows of SEEN, shape (k,), were measured with the setup.
        """
        bands = np.column_stack([rows[name] for name in _BAND])
        return bands[:, :2] if self.begun is None else _seen(bands, setup, self.begun)[:, :2]

    def make(
        self,
        found: Correction,
        state: TrackerState,
        log: SightingLog,
        setups: tuple[Setup, Setup],
    ) -> None:
        """Take what was measured so far as corrected numbers have it.

        State and log are written; setups are that with which was measured, and the new one.
        """
        marks, cylinder = state.marks, state.run.cylinder
        found = _with_unseen(found, turned(marks, found.errors, setups))
        self.begun = self.begun or setups[0]
        self.change[:, found.markers] += [found.theta, found.z] - _places(marks, found)
        self.moved += measure_again(log.sightings, *setups)
        factors = (1.0 + self.errors) / (1.0 + found.errors)
        scale = float(factors[SCALE] * factors[TIMES])
        self.errors, self.made, self.posed = found.errors, found.carried, found.posed
        log.forget(found.unexplained)
        reported = np.array([[float(cylinder.time)], [float(cylinder.angle) - self.ahead]])
        ahead = float(self.turned_ahead(log.motion, reported)[0])
        _turn(state, ahead - self.ahead, scale)
        state.run.shift = self._shift(log)
        _place(marks, found, math.exp(self.area - found.area))
        self.ahead, self.area = ahead, found.area

    def _shift(self, log: SightingLog) -> float:
        """Return by how much the azimuth of P0 exceeds the cylinder's angle [rad]."""
        seen = log.sightings[log.sightings[:, MARKER] == 0]
        newest = seen[seen[:, LAP] == seen[:, LAP].max()]
        angle = newest[:, ANGLE] + self.turned_ahead(log.motion, newest[:, [TIME, ANGLE]].T)
        azimuth = newest[:, AZIMUTH] + math.tau * newest[:, LAP]
        return float(np.median(azimuth - angle))


def _with_unseen(found: Correction, turned: Correction) -> Correction:
    """Return a correction with known markers that it has no sightings of, as the camera has them.

    They are doubted as much as any other one, and more if they are wound further from P0.
    """
    unseen = ~np.isin(turned.markers, [*found.markers, *found.unexplained])
    further = np.maximum(turned.theta[unseen] / max(found.theta.max(), 1.0), 1.0)
    doubt = found.doubt.max(axis=1, keepdims=True) * further**2
    return replace(
        found,
        markers=np.append(found.markers, turned.markers[unseen]),
        theta=np.append(found.theta, turned.theta[unseen]),
        z=np.append(found.z, turned.z[unseen]),
        doubt=np.hstack([found.doubt, doubt]),
    )


def _places(marks: Marks, found: Correction) -> FloatArray:
    """Return wound angle [rad] and z [m] from P0 of corrected markers, shape (2, k)."""
    height = marks.height - marks.height[0]
    return np.array([marks.theta[found.markers], height[found.markers]])


def _seen(bands: FloatArray, old: Setup, new: Setup) -> FloatArray:
    return seen_again(old.camera, old.body, new.camera, new.body, bands)


def measure_again(sightings: FloatArray, old: Setup, new: Setup) -> float:
    """Write bands of `Seen.rows` as a new setup has them; return what P0's azimuths gain [rad]."""
    bands = sightings[:, AZIMUTH:].copy()
    bands[:, 0] += math.tau * sightings[:, LAP]
    again = _seen(bands, old, new)
    grown = again[:, 0] - bands[:, 0]
    sightings[:, AZIMUTH] += grown
    sightings[:, [Z, LOW, HIGH]] = again[:, 1:]
    return float(grown[sightings[:, MARKER] == 0].mean())


def _turn(state: TrackerState, ahead: float, scale: float) -> None:
    """Take an angle of the cylinder that is further `ahead` [rad], wound angles times a scale."""
    run = state.run
    run.cylinder.angle += ahead
    run.cylinder.read += ahead
    run.guide.since += ahead
    if scale == 1.0:
        return
    places, filled = PATH_STEP * np.arange(state.paths.shape[1]), run.path_filled
    for path in state.paths:
        path[:] = np.interp(places / scale, places[:filled], path[:filled])
    run.path_filled = max(1, min(int(filled * scale), places.size))


def _place(marks: Marks, found: Correction, area: float) -> None:
    """Take other places of the markers, and so many times what is measured of expected areas.

    What is published goes over to them.
    """
    known = found.markers
    turn, rise = [found.theta, found.z] - _places(marks, found)
    marks.left_theta[known] -= turn
    marks.left_height[known] -= rise
    for name in ("recent", "reference"):
        slip = getattr(marks, name)[known] - marks.theta[known]
        # What slipped less than is corrected was measured with another angle of the cylinder.
        getattr(marks, name)[known] = found.theta + np.where(np.abs(slip) > np.abs(turn), slip, 0.0)
    marks.theta[known] = found.theta
    marks.height[known] = found.z
    marks.area[known] *= area
    marks.doubt_theta[known], marks.doubt_height[known] = found.doubt
    # They may be other markers, or none.
    marks.known[found.unexplained] = False
