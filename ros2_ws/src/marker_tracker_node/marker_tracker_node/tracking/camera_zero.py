"""The camera's turn: from P0 at rest in many frames, or from a pass of P0 where it never rested."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.camera.pinhole import PinholeCamera
from marker_tracker_node.detection.colour import ColourModel, ColourRefusedError
from marker_tracker_node.detection.zeroing import pass_turn, tilted, zeroed_pose
from marker_tracker_node.tracking.band_measurement import WHOLE_AREA
from marker_tracker_node.tracking.colour_sampling import NEAR_START, locate_marker
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.state import Output, Setup

ByteArray = NDArray[np.uint8]
FloatArray = NDArray[np.float64]

# A cylinder that moved less from one frame to the next stood: an encoder of 8192 counts has steps
# of 0.8 mrad.
REST_STEP = 1.0e-3
REST_FRAMES = 16
# A mount that was set with level and ruler stands within 5 mm at 0.4 m. More is no tilt that a
# calibration leaves, but a camera that was moved or an encoder that is not zeroed.
MOST_TURN = 0.0125
# Poses that differ by less are the same [rad], and what was measured with either stays.
SAME_TURN = 2.0e-4
# What a pass must have shown: frames so far apart [rad], at an even speed; it has ended when P0 was
# not seen for so long [rad].
PASS_FRAMES, LOOK_STEP, PASS_EVENNESS, PASS_GAP = 12, 0.01, 0.1, 0.5
MOST_PASSES = 3
# It counts if it tells the turn so well, and replaces frames at rest that it contradicts [rad].
PASS_SIGMA, CONTRADICTION = 1.0e-3, 1.5e-3


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
        self._rest: list[FloatArray] = []
        self._passed: list[list[float]] = []
        self._stand = self._looked = math.nan
        self._moved = False
        self._passes = 0
        self._pass_told = False

    @property
    def told(self) -> bool:
        """Whether P0 has told the turn, and it was applied where it is large enough."""
        return not self.remark and (bool(self._rest) or self._pass_told)

    def take(self, frame: ByteArray, colour: ColourModel, setup: Setup, angle: float) -> bool:
        """Take a frame before it is measured; return whether the pose has changed.

        Args:
            frame: Shape (rows, columns, 3).
            colour: Of the markers.
            setup: Machine and camera as used at present.
            angle: Of the cylinder where P0 lands at zero [rad]; nan where it is missing.
        """
        if math.isnan(angle) or not self._rests(angle) or len(self._rest) >= REST_FRAMES:
            return False
        place = math.remainder(angle, 2.0 * math.pi)
        if abs(place) > NEAR_START:
            return False
        try:
            pixel = locate_marker(frame, colour, setup, place, WHOLE_AREA)
        except ColourRefusedError:
            return False
        body = self._config.body
        turned = zeroed_pose(self._camera, self._config.pose, body, pixel, place)
        self._rest.append(np.subtract(turned.tilt[:2], self._config.pose.tilt[:2]))
        return self._turn(np.median(self._rest, axis=0))

    def saw(self, t: float, out: Output) -> bool:
        """Take what was measured of a frame; return whether the pose has changed.

        Args:
            t: Its time [s].
            out: Of one frame.
        """
        angle = float(out.angle[0])
        if self._rests(angle) or math.isnan(angle):
            return False
        seen = math.isfinite(out.azimuth[0, 0])
        if seen and not abs(angle - self._looked) < LOOK_STEP:
            self._looked = angle
            numbers = (out.azimuth, out.seen_height, out.slope, out.low, out.high)
            self._passed.append([t, angle, *(float(number[0, 0]) for number in numbers)])
        if not self._passed or abs(angle - self._passed[-1][1]) < PASS_GAP:
            return False
        return self._judge(np.array(self._passed))

    def _rests(self, angle: float) -> bool:
        """Return whether the cylinder stands where it stood, at zero or in two frames."""
        if math.isnan(self._stand):
            self._stand = angle
            return abs(angle) < REST_STEP
        self._moved |= abs(angle - self._stand) >= REST_STEP
        return not self._moved

    def _judge(self, rows: FloatArray) -> bool:
        """Turn the camera by a pass that has ended, if that says something; return whether."""
        self._passed.clear()
        self._passes += 1
        self.done = self._passes >= MOST_PASSES
        if len(rows) < PASS_FRAMES:
            return False
        speed = np.gradient(rows[:, 1], rows[:, 0])
        if np.ptp(speed) > PASS_EVENNESS * abs(speed).mean():
            # A camera whose clock is off sees P0 elsewhere at every speed.
            return False
        turn, sigma = pass_turn(self._camera, self._config.pose, self.pose, self._config.body, rows)
        told = sigma <= PASS_SIGMA
        self.done |= bool(told.all())
        self._pass_told |= bool(told.all())
        before = np.subtract(self.pose.tilt[:2], self._config.pose.tilt[:2])
        least = np.maximum(CONTRADICTION, 3.0 * sigma) if self._rest else sigma
        new = told & (np.abs(turn - before) > least)
        return bool(new.any()) and self._turn(np.where(told, turn, before))

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
        pose = tilted(self._config.pose, turn)
        if np.abs(np.subtract(pose.tilt, self.pose.tilt)).max() < SAME_TURN:
            return False
        self.pose = pose
        return True
