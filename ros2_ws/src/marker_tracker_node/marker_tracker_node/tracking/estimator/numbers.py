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
        """Largest error that is estimated; an estimate there is unknown."""
        return _MOST_PLACE if self.unit == "m" else _MOST

    def sentence(self, error: float) -> str:
        """Return by how much the number is wrong, set too large by an error, in words."""
        if not self.unit:
            return f"{self.words} {abs(error):.1%} too {'large' if error > 0.0 else 'small'}"
        return f"{self.words} {1.0e3 * error:+.1f} m{self.unit}"


# Doubts are those of the usual means: no gear slips, and clocks keep far better time.
NUMBERS = (
    Number("encoder_scale", 5.0e-4, "the encoder's angles are"),
    Number("frame_times", 5.0e-4, "the times of the frames are"),
    # A frame at 200 frames/s; and what is assumed of an encoder's zero.
    Number("camera_clock", 5.0e-3, "the camera's clock is ahead of the encoder's by", "s"),
    Number("encoder_zero", 0.02, "the encoder's zero is wrong by", "rad"),
    # A spirit level, along an edge for the roll; a steel rule, and a tape measure.
    Number("camera_tilt_x", 0.01, "the camera's tilt about x is wrong by", "rad"),
    Number("camera_tilt_y", 0.01, "the camera's tilt about y is wrong by", "rad"),
    Number("camera_roll", 5.0e-3, "the camera's roll is wrong by", "rad"),
    Number("camera_distance", 7.0e-4, "the camera's distance is wrong by", "m"),
    Number("camera_height", 2.0e-3, "the camera's height is wrong by", "m"),
    Number("camera_along", 2.0e-3, "the camera's place along the axis is wrong by", "m"),
    # Six views of a board, see docs/vision.md; a caliper.
    Number("focal_length", 1.0e-3, "the focal length is set"),
    Number("cylinder_diameter", 1.0e-3, "the cylinder diameter is set"),
    # A cable flattens, its jacket varies; bands are painted by hand.
    Number("cable_diameter", 0.01, "the cable diameter is set"),
    Number("band_width", 0.04, "the band width is set"),
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
