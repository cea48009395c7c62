"""Where the camera looks: its turn, from P0 at rest and as it passes."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from marker_tracker_node.arrays import ByteArray, FloatArray
from marker_tracker_node.camera.pinhole import CameraPose, PinholeCamera, plane_of_pixel
from marker_tracker_node.detection.band import Band, solve_band
from marker_tracker_node.detection.colour import ColourModel, ColourRefusedError
from marker_tracker_node.detection.colour_band import WHOLE_AREA
from marker_tracker_node.tracking.camera_clock import AZIMUTH_SIGMA
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.estimator.fit import LEAST_ROWS, SURE, fitted
from marker_tracker_node.tracking.estimator.numbers import CLOCK, NUMBERS, ROLL, TILT, ZERO
from marker_tracker_node.tracking.estimator.problem import Problem, Seen
from marker_tracker_node.tracking.estimator.verdict import SIGNIFICANT
from marker_tracker_node.tracking.frame.laid_path import BAND_REACH, LOOK_STEP, PROOF_HITS
from marker_tracker_node.tracking.frame.run_means import REFERENCE_FRAMES
from marker_tracker_node.tracking.machine_motion import STILL
from marker_tracker_node.tracking.p0_search import locate_marker
from marker_tracker_node.tracking.state import Burst, Setup

# More than a level along an edge leaves is no tilt of a mount that was set with one, but a camera
# that was moved or an encoder that is not zeroed [rad].
MOST_TURN = SIGNIFICANT * NUMBERS[ROLL].doubt
# Poses that differ by less in a picture are the same [px], and what was measured with either stays.
SAME_PICTURE = 0.5
_TILTS = range(TILT, ROLL)
# Of a band beside which no turn lies.
_ALONE = Band(0.0, 0.0, 0.0)[5:]


class CameraZero:
    """Collects where P0's band appears while its place is known.

    Attributes:
        pose: Of the camera, turned by what was found.
        done: Whether nothing will change it any more.
        remark: What was found and not applied; empty if nothing.
    """

    def __init__(self, config: TrackerConfig, camera: PinholeCamera) -> None:
        """Start with the nominal pose."""
        self.pose = config.pose
        self.done = False
        self.remark = ""
        self._config = config
        self._camera = camera
        self._rest: list[list[float]] = []
        self._passed: list[list[float]] = []
        self._stand = self._looked = math.nan
        self._moved = False
        self._passes = 0
        self._pass_known = False

    @property
    def found(self) -> bool:
        """Whether P0 has shown the turn, and it was applied where it is large enough."""
        return not self.remark and (bool(self._rest) or self._pass_known)

    def take(self, frame: ByteArray, colour: ColourModel, setup: Setup, angle: float) -> bool:
        """Take a frame before it is measured; return whether the pose has changed.

        An uncorrected milliradian would shift every wound angle by 20 on a small cylinder. The
        angle is that of the cylinder where P0 lands at zero [rad], nan where it is missing.
        """
        if math.isnan(angle) or not self._rests(angle) or len(self._rest) >= REFERENCE_FRAMES:
            return False
        place = math.remainder(angle, math.tau)
        if abs(place) > BAND_REACH:
            return False
        try:
            pixel = locate_marker(frame, colour, setup, place, WHOLE_AREA)
        except ColourRefusedError:
            return False
        view, body = self._camera.view(self._config.pose), self._config.body
        band = Band(azimuth=place, z=0.0, slope=0.0)
        azimuth, z = solve_band(view, body, *plane_of_pixel(view, *pixel), band)
        if not math.isfinite(azimuth):
            return False
        self._rest.append([place, azimuth, z, band.slope, band.low, band.high])
        # Its place is known: two numbers of P0 determine both turns.
        return self._turn(self._explained(np.array(self._rest), self._config.pose, _TILTS)[0])

    def saw(self, t: float, out: Burst) -> bool:
        """Take what a frame of time t [s] yielded; return whether the pose has changed."""
        angle = float(out.angle[0])
        if self._rests(angle) or math.isnan(angle):
            return False
        p0 = out.rows[0, 0]
        seen = math.isfinite(p0["azimuth"])
        if seen and not abs(angle - self._looked) < LOOK_STEP:
            self._looked = angle
            names = ("azimuth", "seen_height", "slope", "low", "high")
            self._passed.append([t, angle, *(float(p0[name]) for name in names)])
        # Then it has passed.
        if not self._passed or abs(angle - self._passed[-1][1]) < BAND_REACH:
            return False
        return self._judge(np.array(self._passed))

    def _rests(self, angle: float) -> bool:
        """Return whether the cylinder stands where it stood, at zero or in two frames."""
        if math.isnan(self._stand):
            self._stand = angle
            return abs(angle) < STILL
        self._moved |= abs(angle - self._stand) >= STILL
        return not self._moved

    def _judge(self, rows: FloatArray) -> bool:
        """Turn the camera by a pass that has ended, if it constrains the turn; return whether.

        A turn shifts the picture as a whole, a wrong zero of the encoder shifts it less the further
        P0 has come round: a pass tells them apart as far as it reaches to the side.
        """
        self._passed.clear()
        self._passes += 1
        self.done = self._passes >= PROOF_HITS
        if len(rows) < LEAST_ROWS:
            return False
        speed = np.gradient(rows[:, 1], rows[:, 0])
        if np.ptp(speed) * NUMBERS[CLOCK].doubt > AZIMUTH_SIGMA:
            # A camera whose clock is off sees P0 elsewhere at every speed.
            return False
        turn, sigma = self._explained(rows[:, 1:], self.pose, (*_TILTS, ZERO))
        # It counts if it shows the turn as well as a single azimuth is known.
        known = sigma <= AZIMUTH_SIGMA
        self.done |= bool(known.all())
        self._pass_known |= bool(known.all())
        before = np.subtract(self.pose.tilt[:2], self._config.pose.tilt[:2])
        least = SURE * np.maximum(sigma, 0.5 * AZIMUTH_SIGMA) if self._rest else sigma
        new = known & (np.abs(turn - before) > least)
        return bool(new.any()) and self._turn(np.where(known, turn, before))

    def _explained(
        self, rows: FloatArray, used: CameraPose, doubted: Iterable[int]
    ) -> tuple[FloatArray, FloatArray]:
        """Return the turn of the nominal pose that explains P0 [rad], and its deviation, (2,) each.

        Rows are the angle of the cylinder [rad], and azimuth, z, slope, low and high of P0's band
        (see `Band`) as measured with a pose, shape (k, 6); the doubted numbers are not taken as
        configured.
        """
        count, angle = len(rows), rows[:, :1]
        problem = Problem(
            Seen(
                # The cylinder's angle serves as time; no turn lies beside P0 yet.
                rows=np.hstack([np.zeros((count, 2)), angle, rows, np.tile(_ALONE, (count, 1))]),
                motion=np.repeat([angle.min(axis=0), angle.max(axis=0) + 1.0], 2, axis=1),
                area=math.nan,
                zeroed=False,
                camera=self._camera,
                used=used,
                nominal=self._config.pose,
                body=self._config.body,
            )
        )
        prior = problem.doubting({number: NUMBERS[number].most for number in doubted})
        fit = fitted(problem, prior, problem.start)
        return -fit.x[_TILTS], np.sqrt(np.diag(fit.covariance)[_TILTS])

    def _turn(self, turn: FloatArray) -> bool:
        """Turn the nominal pose, unless that is too far; return whether the pose has changed."""
        size = float(np.hypot(*turn))
        if size > MOST_TURN:
            self.remark = (
                f"P0 stands where the camera would be turned by {1e3 * size:.1f} mrad, limit "
                f"{1e3 * MOST_TURN:.1f} mrad, which is not applied: set camera_tilt, "
                "camera_position or start_angle"
            )
            return False
        x, y, z = self._config.pose.tilt
        pose = replace(self._config.pose, tilt=(x + float(turn[0]), y + float(turn[1]), z))
        focal = math.sqrt(self._camera.k[0, 0] * self._camera.k[1, 1]) / self._camera.binning
        if np.linalg.norm(np.subtract(pose.tilt, self.pose.tilt)) * focal < SAME_PICTURE:
            return False
        self.pose = pose
        return True
