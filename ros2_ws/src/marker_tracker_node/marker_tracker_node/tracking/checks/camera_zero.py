"""The camera's turn: from P0 at rest in many frames, or from a pass of P0 where it never rested."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from marker_tracker_node.arrays import ByteArray, FloatArray
from marker_tracker_node.camera.pinhole import CameraPose, PinholeCamera, plane_of_pixel
from marker_tracker_node.detection.band import Band, Body, band_centroid
from marker_tracker_node.detection.colour import ColourModel, ColourRefusedError
from marker_tracker_node.detection.colour_band import WHOLE_AREA
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.estimator.fit import fitted
from marker_tracker_node.tracking.estimator.numbers import TILT, ZERO
from marker_tracker_node.tracking.estimator.problem import Problem, Seen
from marker_tracker_node.tracking.p0_search import NEAR_START, locate_marker
from marker_tracker_node.tracking.state import Burst, Setup

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
# It counts if it shows the turn so well, and replaces frames at rest that it contradicts [rad].
PASS_SIGMA, CONTRADICTION = 1.0e-3, 1.5e-3
NEWTON_STEPS = 6
SMALL_TURN = 1.0e-6
# A single frame cannot improve a pose that explains it this well.
TRUSTED_PIXELS = 0.5
# Of a pass: what is believed before it of both turns and of the encoder's zero, clocks included
# [rad]. Every other number is taken as it is configured.
BELIEFS = {TILT: 0.02, TILT + 1: 0.02, ZERO: 0.1}


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
        self._pass_known = False

    @property
    def found(self) -> bool:
        """Whether P0 has shown the turn, and it was applied where it is large enough."""
        return not self.remark and (bool(self._rest) or self._pass_known)

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

    def saw(self, t: float, out: Burst) -> bool:
        """Take what was measured of a frame; return whether the pose has changed.

        Args:
            t: Its time [s].
            out: Of one frame.
        """
        angle = float(out.angle[0])
        if self._rests(angle) or math.isnan(angle):
            return False
        p0 = out.rows[0, 0]
        seen = math.isfinite(p0["azimuth"])
        if seen and not abs(angle - self._looked) < LOOK_STEP:
            self._looked = angle
            names = ("azimuth", "seen_height", "slope", "low", "high")
            self._passed.append([t, angle, *(float(p0[name]) for name in names)])
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
        """Turn the camera by a pass that has ended, if it constrains the turn; return whether."""
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
        known = sigma <= PASS_SIGMA
        self.done |= bool(known.all())
        self._pass_known |= bool(known.all())
        before = np.subtract(self.pose.tilt[:2], self._config.pose.tilt[:2])
        least = np.maximum(CONTRADICTION, 3.0 * sigma) if self._rest else sigma
        new = known & (np.abs(turn - before) > least)
        return bool(new.any()) and self._turn(np.where(known, turn, before))

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


def zeroed_pose(
    camera: PinholeCamera,
    pose: CameraPose,
    body: Body,
    pixel: tuple[float, float],
    angle: float,
) -> CameraPose:
    """Return the pose, turned about the camera's x and y axes, that explains P0's picture.

    One frame holds two numbers of P0, and its place is known: two of the pose's unknowns follow.
    An uncorrected milliradian would shift every wound angle by 20 on a small cylinder.

    Args:
        camera: The camera.
        pose: Nominal.
        body: What the band is painted on.
        pixel: Column and row of the centroid of P0's band [pixels].
        angle: Azimuth of P0, the cylinder angle [rad].
    """
    goal = np.array(plane_of_pixel(camera.view(pose), *pixel))

    def seen(turn: FloatArray) -> FloatArray:
        view = camera.view(tilted(pose, turn))
        return np.array(band_centroid(view, body, Band(azimuth=angle, z=0.0, slope=0.0))[:2])

    turn = np.zeros(2)
    focal = math.sqrt(camera.k[0, 0] * camera.k[1, 1]) / camera.binning
    if np.linalg.norm(seen(turn) - goal) * focal < TRUSTED_PIXELS:
        return pose
    for _ in range(NEWTON_STEPS):
        residual = seen(turn) - goal
        slope = np.column_stack(
            [(seen(turn + step) - seen(turn)) / SMALL_TURN for step in SMALL_TURN * np.eye(2)]
        )
        turn -= np.linalg.solve(slope, residual)
    return tilted(pose, turn)


def pass_turn(
    camera: PinholeCamera, nominal: CameraPose, used: CameraPose, body: Body, rows: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the turn about the camera's x and y axes that explains a pass of P0, and its error.

    A turn shifts the picture as a whole, a wrong zero of the encoder shifts it less the further
    P0 has come round: a pass tells them apart as far as it reaches to the side.

    Args:
        camera: The camera.
        nominal: Pose that is turned.
        used: Pose with which P0 was measured.
        body: What the band is painted on.
        rows: Time [s], angle of the cylinder [rad], and azimuth, z, slope, low and high of P0's
            band (see `Band`) of each frame, shape (k, 7).

    Returns:
        Turn [rad] and one standard deviation, each of shape (2,).
    """
    count = len(rows)
    problem = Problem(
        Seen(
            rows=np.column_stack([np.zeros((count, 2)), rows, np.full((count, 2), math.inf)]),
            motion=rows[:, :2],
            area=math.nan,
            zeroed=False,
            camera=camera,
            used=used,
            nominal=nominal,
            body=body,
        )
    )
    prior = problem.doubting(BELIEFS)
    fit = fitted(problem, prior, problem.start)
    spread = np.linalg.inv(fit.normal + np.diag(prior))
    turn = slice(TILT, TILT + 2)
    return -fit.x[turn], np.sqrt(np.diag(spread)[turn])


def tilted(pose: CameraPose, turn: FloatArray) -> CameraPose:
    """Return a pose turned about the camera's x and y axes [rad]."""
    x, y, z = pose.tilt
    return replace(pose, tilt=(x + float(turn[0]), y + float(turn[1]), z))
