"""The configured numbers that are estimated, how well each is known, and all without errors."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from marker_tracker_node.arrays import FloatArray
from marker_tracker_node.camera.pinhole import CameraPose, PinholeCamera
from marker_tracker_node.detection.band import Body

# Beyond a tenth of a metre a camera stands elsewhere; beyond a half nothing is what was configured.
_MOST_PLACE, _MOST = 0.1, 0.5


class Number(NamedTuple):
    """A configured number."""

    name: str
    doubt: float  # One standard deviation of what is configured, relative or in SI
    words: str  # What it is in sentences
    unit: str = ""  # Of which a thousandth is printed; empty for relative errors

    @property
    def most(self) -> float:
        """Largest error that is believed; an estimate there is unknown."""
        return _MOST_PLACE if self.unit == "m" else _MOST

    def sentence(self, error: float) -> str:
        """Return by how much the number is wrong, set too large by an error, in words."""
        if not self.unit:
            return f"{self.words} {abs(error):.1%} too {'large' if error > 0.0 else 'small'}"
        return f"{self.words} {1.0e3 * error:+.1f} m{self.unit}"


# Scales of encoder and times: no gear slips, clocks keep far better time.
_CLOCKWORK = 5.0e-4
# A bracket's pose: a spirit level, along an edge for the roll; a tape measure, a steel rule.
_LEVEL, _ROLL, _TAPE, _RULE = 0.01, 5.0e-3, 2.0e-3, 7.0e-4
# Diameters: a caliper. Focal length: six views of a board, see docs/vision.md.
_CALIPER = 1.0e-3
# Camera's clock: a frame at 200 frames/s. A cable flattens, its jacket varies; bands are painted by
# hand; the encoder's zero is assumed.
_FRAME, _CABLE, _PAINT, _ZERO = 5.0e-3, 0.01, 0.04, 0.02
NUMBERS = (
    Number("encoder_scale", _CLOCKWORK, "the encoder's angles are"),
    Number("frame_times", _CLOCKWORK, "the times of the frames are"),
    Number("camera_clock", _FRAME, "the camera's clock is ahead of the encoder's by", "s"),
    Number("encoder_zero", _ZERO, "the encoder's zero is wrong by", "rad"),
    Number("camera_tilt_x", _LEVEL, "the camera's tilt about x is wrong by", "rad"),
    Number("camera_tilt_y", _LEVEL, "the camera's tilt about y is wrong by", "rad"),
    Number("camera_roll", _ROLL, "the camera's roll is wrong by", "rad"),
    Number("camera_distance", _RULE, "the camera's distance is wrong by", "m"),
    Number("camera_height", _TAPE, "the camera's height is wrong by", "m"),
    Number("camera_along", _TAPE, "the camera's place along the axis is wrong by", "m"),
    Number("focal_length", _CALIPER, "the focal length is set"),
    Number("cylinder_diameter", _CALIPER, "the cylinder diameter is set"),
    Number("cable_diameter", _CABLE, "the cable diameter is set"),
    Number("band_width", _PAINT, "the band width is set"),
)
COUNT = len(NUMBERS)
SCALE, TIMES, CLOCK, ZERO, TILT, _, ROLL, PLACE, _, _, FOCAL, CYLINDER, CABLE, BAND = range(COUNT)
# A step of the fit may lead beyond, where a number has no logarithm.
LEAST = np.array([-number.most for number in NUMBERS])


def pose_without(pose: CameraPose, errors: FloatArray) -> CameraPose:
    """Return a configured pose without its errors, see `NUMBERS`, shape (numbers,)."""
    return CameraPose.of(pose.numbers - errors[TILT : TILT + 6])


def camera_without(camera: PinholeCamera, errors: FloatArray) -> PinholeCamera:
    """Return a configured camera without the error of its focal length."""
    k = camera.k.copy()
    k[[0, 1], [0, 1]] /= 1.0 + float(errors[FOCAL])
    return replace(camera, k=k)


def body_without(body: Body, errors: FloatArray) -> Body:
    """Return what is configured of cylinder, cable and bands without its errors."""
    cylinder, cable, band = (
        1.0 + max(float(errors[k]), float(LEAST[k])) for k in (CYLINDER, CABLE, BAND)
    )
    r = body.cable_radius / cable
    radius = (body.rho - body.cable_radius) / cylinder
    return body._replace(rho=radius + r, cable_radius=r, half_band=body.half_band / band)
