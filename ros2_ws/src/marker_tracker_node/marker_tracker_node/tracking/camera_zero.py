"""The camera's turn: from P0 at rest in many frames, or from a pass of P0 where it never rested."""

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
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.estimator.fit import LEAST_ROWS, SURE, fitted
from marker_tracker_node.tracking.estimator.numbers import NUMBERS, ROLL, TILT, ZERO
from marker_tracker_node.tracking.estimator.problem import ANGLE, MARKER, TIME, Problem, Seen
from marker_tracker_node.tracking.estimator.verdict import SIGNIFICANT
from marker_tracker_node.tracking.frame.acquisition import P0_REACH
from marker_tracker_node.tracking.machine_motion import STILL
from marker_tracker_node.tracking.p0_search import NEAR_START, locate_marker
from marker_tracker_node.tracking.sighting_log import SightingLog
from marker_tracker_node.tracking.state import Setup

# Frames at rest: their scatter is a quarter of one frame's then.
REST_FRAMES = 16
# More than a level along an edge leaves is no tilt of a mount that was set with one, but a camera
# that was moved or an encoder that is not zeroed [rad].
MOST_TURN = SIGNIFICANT * NUMBERS[ROLL].doubt
# Poses that differ by less in a picture are the same [px], and what was measured with either stays.
SAME_PICTURE = 0.5
# A pass is seen at an even speed; so many are looked at.
PASS_EVENNESS, MOST_PASSES = 0.1, 3
# It counts if it shows the turn so well, and replaces frames at rest that it contradicts [rad].
PASS_SIGMA, CONTRADICTION = 1.0e-3, 1.5e-3
_TILTS = range(TILT, ROLL)


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
        self._stand, self._judged = math.nan, -math.inf
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
        if math.isnan(angle) or not self._rests(angle) or len(self._rest) >= REST_FRAMES:
            return False
        place = math.remainder(angle, math.tau)
        if abs(place) > NEAR_START:
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
        # The cylinder's angle serves as time.
        self._rest.append([0, 0, place, place, azimuth, z, *band[2:]])
        motion = np.array([[place, place], [place + 1.0, place + 1.0]])
        # Its place is known: two numbers of P0 determine both turns.
        turn, _ = self._explained(np.array(self._rest), motion, self._config.pose, _TILTS)
        return self._turn(turn)

    def saw(self, log: SightingLog, angle: float) -> bool:
        """Look for a pass of P0 in the log that has ended at an angle [rad], nan where missing.

        Return whether the pose has changed.
        """
        if math.isnan(angle) or self._rests(angle):
            return False
        rows = log.sightings[log.sightings[:, MARKER] == 0]
        rows = rows[rows[:, TIME] > self._judged]
        # Then it has passed.
        if not len(rows) or abs(angle - rows[-1, ANGLE]) < P0_REACH:
            return False
        self._judged = rows[-1, TIME]
        return self._judge(rows, log.motion)

    def _rests(self, angle: float) -> bool:
        """Return whether the cylinder stands where it stood, at zero or in two frames."""
        if math.isnan(self._stand):
            self._stand = angle
            return abs(angle) < STILL
        self._moved |= abs(angle - self._stand) >= STILL
        return not self._moved

    def _judge(self, rows: FloatArray, motion: FloatArray) -> bool:
        """Turn the camera by a pass that has ended, if it constrains the turn; return whether.

        A turn shifts the picture as a whole, a wrong zero of the encoder shifts it less the further
        P0 has come round: a pass tells them apart as far as it reaches to the side.
        """
        self._passes += 1
        self.done = self._passes >= MOST_PASSES
        if len(rows) < LEAST_ROWS:
            return False
        speed = np.gradient(rows[:, ANGLE], rows[:, TIME])
        if np.ptp(speed) > PASS_EVENNESS * abs(speed).mean():
            # A camera whose clock is off sees P0 elsewhere at every speed.
            return False
        turn, sigma = self._explained(rows, motion, self.pose, (*_TILTS, ZERO))
        known = sigma <= PASS_SIGMA
        self.done |= bool(known.all())
        self._pass_known |= bool(known.all())
        before = np.subtract(self.pose.tilt[:2], self._config.pose.tilt[:2])
        least = np.maximum(CONTRADICTION, SURE * sigma) if self._rest else sigma
        new = known & (np.abs(turn - before) > least)
        return bool(new.any()) and self._turn(np.where(known, turn, before))

    def _explained(
        self, rows: FloatArray, motion: FloatArray, used: CameraPose, doubted: Iterable[int]
    ) -> tuple[FloatArray, FloatArray]:
        """Return the turn of the nominal pose that explains P0 [rad], and its deviation, (2,) each.

        Rows and motion are those of `Seen`, measured with a pose; the doubted numbers are not taken
        as configured.
        """
        problem = Problem(
            Seen(
                rows=rows,
                motion=motion,
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
