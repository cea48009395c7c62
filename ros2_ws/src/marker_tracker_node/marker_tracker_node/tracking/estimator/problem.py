"""The measurement model: residuals of all sightings, and their derivatives by every unknown.

Unknown are the configured numbers, by how much each is set too large, wound angle and height of
every marker, and what the mask has wrong in all frames:

    Theta = Theta_encoder((t - d) / (1 + s)) / (1 + e), times counted from the first
    picture = f / f_set  projection(pose, R, r; Theta + phi - theta_n, z_n)
    measured = picture + bias(azimuth) + noise
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from marker_tracker_node.arrays import FloatArray
from marker_tracker_node.camera.pinhole import CameraPose, CameraView, PinholeCamera
from marker_tracker_node.detection.band import Band, Body, band_centroid
from marker_tracker_node.detection.colour_band import WHOLE_AREA
from marker_tracker_node.tracking.estimator import pictures
from marker_tracker_node.tracking.estimator.mask_bias import (
    COMMON,
    CUT_SCATTER,
    IN_ANY_LIGHT,
    LIFT_SIGMA,
    bias_shapes,
    cut_off,
)
from marker_tracker_node.tracking.estimator.numbers import (
    BAND,
    CABLE,
    CLOCK,
    COUNT,
    CYLINDER,
    FOCAL,
    LEAST,
    NUMBERS,
    PLACE,
    SCALE,
    TILT,
    TIMES,
    ZERO,
    body_without,
    camera_without,
    pose_without,
)
from marker_tracker_node.tracking.frame.laid_path import PROOF_HITS
from marker_tracker_node.tracking.frame.run_means import MEMORY, SIGHTING

# Inverse variance of what is taken as it is, to a micrometre or a microradian.
HELD = 1.0e12
# Columns of sightings; the last ones are fields of `Band`.
MARKER, LAP, TIME, ANGLE, AZIMUTH, Z, _, LOW, HIGH, _, _, _, COLUMNS = range(13)
# Bands of consistent runs are up to 5 % smaller than they are, as their edges are mixed pixels, or
# 5 % larger where they are blurred.
AREA_SIGMA = 0.035


@dataclass(frozen=True, kw_only=True)
class Seen:
    """What is explained.

    Attributes:
        rows: Sightings: marker, lap, t [s], encoder angle [rad], azimuth within the lap [rad],
            and z, slope, low, high, below, above, lift as in `Band`, shape (k, 12).
        begun: Pose with which the run began, from P0 where it has given one; None for the nominal.
        without: Errors of focal length and body that were taken off for azimuth and z, see
            `NUMBERS`, shape (numbers,); zero for the configured ones.
    """

    rows: FloatArray
    motion: FloatArray  # The cylinder as the encoder reported it, shape (n, 2): t [s], angle [rad]
    area: float  # Logarithm of the median of measured over expected area; nan if there is none
    zeroed: bool  # Whether the encoder's zero is configured, and not found from P0 itself
    camera: PinholeCamera  # Content of CameraInfo
    used: CameraPose  # Pose with which azimuth and z were computed
    nominal: CameraPose  # Pose as configured
    body: Body  # What the bands are painted on, as configured
    begun: CameraPose | None = None
    without: FloatArray = field(default_factory=lambda: np.zeros(COUNT))

    @classmethod
    def of(cls, *, rows: FloatArray, **others: Any) -> Seen:
        """Return what is explained of all sightings: the first laps and the newest, thinned."""
        kept = np.zeros(len(rows), dtype=bool)
        for marker in np.unique(rows[:, MARKER]):
            own = rows[:, MARKER] == marker
            laps = np.unique(rows[own, LAP])
            chosen = np.concatenate([laps[:PROOF_HITS], laps[PROOF_HITS:][-PROOF_HITS:]])
            kept |= own & np.isin(rows[:, LAP], chosen)
        rows = rows[kept]
        return cls(rows=rows[:: max(-(-len(rows) // MEMORY), 1)], **others)


class Problem:
    """Residuals and derivatives of a run.

    Attributes:
        prior: Inverse variances of the unknowns, shape (unknowns,).
        start: Unknowns that explain the run if every configured number is right.
        sigma: Scatter of each sighting [px], shape (k,).
        markers: Numbers of those that were seen, ascending.
    """

    def __init__(self, seen: Seen, *, any_light: bool = False) -> None:
        """Take what was seen, and whether the mask may have it wrong as in any light and focus."""
        rows = seen.rows
        self._seen = seen
        self.markers, self._index = np.unique(rows[:, MARKER].astype(int), return_inverse=True)
        count = self.markers.size
        self._first_z = COUNT + count
        self._first_bias = COUNT + 2 * count
        turn = math.tau
        azimuth = rows[:, AZIMUTH] + turn * rows[:, LAP]
        self._bands = np.column_stack([azimuth, rows[:, Z:]])
        self._focal = math.sqrt(seen.camera.k[0, 0] * seen.camera.k[1, 1]) / seen.camera.binning
        view = camera_without(seen.camera, seen.without).view(seen.used)
        body = body_without(seen.body, seen.without)
        self._used = body
        found = pictures.band_pictures(view, body, body, self._bands)
        self._goal = found[:, 0] * self._focal / (1.0 + seen.without[FOCAL])
        shares = pictures.own_shares(view, body, self._bands)
        self._cut = np.flatnonzero(shares < 1.0)
        up = found[self._cut, pictures.HEIGHT]
        up /= np.hypot(*up.T)[:, None]
        # What a picture of a band that is cut off says of a way along the cylinder.
        self._known = np.eye(2) - ((1.0 - shares[self._cut]) * up.T).T[:, :, None] * up[:, None]
        cuts = cut_off(self._bands, seen.body.cable_radius)
        out = 2.0 * LIFT_SIGMA * body.cable_radius * self._focal / (view.x - body.rho)
        lifted = np.where(self._bands[:, -1] > 0.0, out, 0.0)
        common = IN_ANY_LIGHT if any_light else COMMON
        self._bias, sigmas = bias_shapes(azimuth, self._index, cuts, lifted, common)
        cut = cuts[0] | cuts[1]
        laps = 1.0 * cut
        self._since = float(seen.motion[0, 0])
        self._speed = np.gradient(seen.motion[:, 1], seen.motion[:, 0])
        self.start = np.zeros(self._first_bias + self._bias.shape[2])
        for i in range(count):
            own = self._index == i
            if any_light:
                # A band is cut off in each lap as in the last: more of them do not show more.
                laps[own & cut] = np.unique(rows[own & cut, LAP]).size
            self.start[COUNT + i] = np.median(rows[own, ANGLE] - azimuth[own])
            self.start[self._first_z + i] = np.median(rows[own & (shares >= shares[own].max()), Z])
        self.sigma = np.hypot(SIGHTING, CUT_SCATTER * np.sqrt(laps))
        self.prior = np.zeros(self.start.size)
        self.prior[:COUNT] = [number.doubt**-2 for number in NUMBERS]
        self.prior[self._first_bias :] = sigmas**-2
        if not seen.zeroed:
            self.prior[ZERO] = NUMBERS[ZERO].most ** -2
        if self.markers[0] == 0:
            # P0 is where angles and heights begin.
            self.prior[COUNT] = self.prior[self._first_z] = HELD
            self.start[COUNT] = self.start[self._first_z] = 0.0
        self._by_area = _area_slopes(view, seen.body)
        self.sigma *= max(_scatter(self.linearised(self.start)[0], rows) / SIGHTING, 1.0)

    def doubting(self, sigmas: Mapping[int, float]) -> FloatArray:
        """Return the prior with these numbers doubted by so much, and all others held."""
        prior = self.prior.copy()
        prior[:COUNT] = HELD
        prior[list(sigmas)] = [1.0 / max(sigma**2, 1.0 / HELD) for sigma in sigmas.values()]
        return prior

    def linearised(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what unknowns, shape (unknowns,), leave unexplained, and its derivatives by them.

        That is the measured less the explained picture, shape (k, 2) [px], and derivatives of what
        is explained, shape (k, 2, unknowns).
        """
        rows = self._seen.rows
        turned, speed, at = self._motion(x)
        late, longer = 1.0 / (1.0 + x[SCALE]), 1.0 / (1.0 + x[TIMES])
        view = self._seen.camera.view(pose_without(self._seen.nominal, x))
        bands = self._bands.copy()
        bands[:, 0] = turned + x[ZERO] - x[COUNT + self._index]
        bands[:, 1] = x[self._first_z + self._index]
        painted = body_without(self._seen.body, x)
        found = pictures.band_pictures(view, self._used, painted, bands)
        # First the picture, then its derivatives.
        by = np.moveaxis(found * (self._focal / (1.0 + x[FOCAL])), 1, 0)
        slopes = np.zeros((len(rows), 2, x.size))
        azimuth = by[pictures.AZIMUTH]
        slopes[:, :, SCALE] = -azimuth * (turned * late)[:, None]
        slopes[:, :, CLOCK] = -azimuth * (speed * longer * late)[:, None]
        slopes[:, :, TIMES] = -azimuth * (speed * longer * late * (at - self._since))[:, None]
        slopes[:, :, ZERO] = azimuth
        for axis in range(3):
            # A pose that is set too large was further back in truth.
            slopes[:, :, TILT + axis] = -by[pictures.TILT + axis]
            slopes[:, :, PLACE + axis] = -by[pictures.PLACE + axis]
        slopes[:, :, FOCAL] = -by[0] / (1.0 + x[FOCAL])
        slopes[:, :, CYLINDER] = -by[pictures.CYLINDER] / (1.0 + x[CYLINDER])
        slopes[:, :, CABLE] = -by[pictures.CABLE] / (1.0 + x[CABLE])
        slopes[:, :, BAND] = -by[pictures.BAND_WIDTH] / (1.0 + x[BAND])
        here = np.arange(len(rows))
        slopes[here, :, COUNT + self._index] = -azimuth
        slopes[here, :, self._first_z + self._index] = by[pictures.HEIGHT]
        slopes[:, :, self._first_bias :] = self._bias
        explained = by[0] + self._bias @ x[self._first_bias :]
        off = self._goal - explained
        off[self._cut] = (self._known @ off[self._cut, :, None])[:, :, 0]
        slopes[self._cut] = self._known @ slopes[self._cut]
        # What lies behind the cylinder, or a step on, is not seen and explains nothing.
        hidden = np.isnan(by).any(axis=(0, 2))
        off[hidden], slopes[hidden] = HELD, 0.0
        return off, slopes

    @property
    def begun(self) -> FloatArray:
        """Errors of the numbers with which the run began, shape (numbers,)."""
        errors, seen = np.zeros(COUNT), self._seen
        if seen.begun is not None:
            errors[TILT : TILT + 6] = seen.nominal.numbers - seen.begun.numbers
        return errors

    def places(self, x: FloatArray) -> FloatArray:
        """Return wound angles [rad] and z [m] of the markers, as a view, shape (2, markers)."""
        return x[COUNT : self._first_bias].reshape(2, -1)

    def unexplained(self, x: FloatArray) -> FloatArray:
        """Return the median square of what is left of each marker's sightings, in its variance."""
        square = ((self.linearised(x)[0] / self.sigma[:, None]) ** 2).sum(axis=1)
        return np.array([np.median(square[self._index == i]) for i in range(self.markers.size)])

    def centred(self, x: FloatArray) -> FloatArray:
        """Return unknowns with every marker but P0 where its sightings are explained best.

        A scale turns late markers by more than a radian, which no small step follows.
        """
        x = x.copy()
        wound = self._motion(x)[0] + x[ZERO] - self._bands[:, 0]
        for i in range(int(self.markers[0] == 0), self.markers.size):
            x[COUNT + i] = np.median(wound[self._index == i])
        return x

    def _motion(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return how far the cylinder had turned [rad], its speed [rad/s], and the time [s]."""
        rows, motion = self._seen.rows, self._seen.motion
        at = self._since + (rows[:, TIME] - x[CLOCK] - self._since) / (1.0 + x[TIMES])
        times = motion[:, 0]
        theta = np.interp(at, times, motion[:, 1])
        speed = np.interp(at, times, self._speed)
        early = np.minimum(at - times[0], 0.0) + np.maximum(at - times[-1], 0.0)
        return (theta + speed * early) / (1.0 + x[SCALE]), speed, at

    def area(self, x: FloatArray) -> tuple[float, FloatArray]:
        """Return what is left of the bands' area, and its derivatives; in deviations.

        Bands beyond the accepted sizes are not measured: of those at a limit the true size lies
        beyond, so that an estimate there is the least that is wrong.
        """
        slopes = np.zeros(x.size)
        share = self._seen.area
        if not math.isfinite(share):
            return 0.0, slopes
        left = (share - self.area_of(x)) / AREA_SIGMA
        slopes[:COUNT] = self._by_area / (AREA_SIGMA * (1.0 + x[:COUNT]))
        smallest, largest = (math.log(limit) for limit in WHOLE_AREA)
        if (share < smallest + AREA_SIGMA and left > 0.0) or (
            share > largest - AREA_SIGMA and left < 0.0
        ):
            left = 0.0
        return left, slopes

    def area_of(self, x: FloatArray) -> float:
        """Return the logarithm of a band's area over that of the configured numbers."""
        return float(self._by_area @ np.log1p(np.maximum(x[:COUNT], LEAST)))


def _scatter(off: FloatArray, rows: FloatArray) -> float:
    """Return what neighbours in a passing differ by beside a straight line [px], over a deviation.

    That is the scatter of a sighting, whatever number is wrong.
    """
    order = np.lexsort((rows[:, TIME], rows[:, LAP], rows[:, MARKER]))
    passing, off = rows[order][:, [MARKER, LAP]], off[order]
    bent = off[:-2] - 2.0 * off[1:-1] + off[2:]
    bent = bent[(passing[2:] == passing[:-2]).all(axis=1)]
    # Of normal numbers the median is 0.67 deviations, and three of them add to the root of six.
    return 1.4826 * float(np.median(np.abs(bent))) / math.sqrt(6.0) if bent.size else 0.0


def _area_slopes(view: CameraView, body: Body) -> FloatArray:
    """Return how the logarithm of a band's area over the expected one goes with the numbers.

    The same bands are as large at every azimuth but for some hundredths: one stands for all.
    """

    def area(errors: FloatArray) -> float:
        band = Band(0.0, view.z, 0.0)
        return math.log(band_centroid(view, body_without(body, errors), band)[2])

    slopes = np.zeros(COUNT)
    for number in (CYLINDER, CABLE, BAND):
        step = np.where(np.arange(COUNT) == number, pictures.STEP, 0.0)
        slopes[number] = (area(step) - area(-step)) / (2.0 * pictures.STEP)
    slopes[FOCAL] = -2.0
    # Set too far, the camera stands nearer.
    slopes[PLACE] = 2.0 / (view.x - body.rho)
    return slopes
