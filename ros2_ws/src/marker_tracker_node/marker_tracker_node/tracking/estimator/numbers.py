"""The configured numbers that are estimated, and how well each is known before the run."""

from __future__ import annotations

from typing import NamedTuple


class Number(NamedTuple):
    """A configured number."""

    name: str
    doubt: float  # One standard deviation of what is configured, relative or in SI
    words: str  # What it is in sentences
    unit: str = ""  # Of which a thousandth is printed; empty for relative errors
    most: float = 0.3  # Largest error that is believed; an estimate there is unknown

    def sentence(self, error: float) -> str:
        """Return by how much the number is wrong, set too large by an error, in words."""
        if not self.unit:
            return f"{self.words} {abs(error):.1%} too {'large' if error > 0.0 else 'small'}"
        return f"{self.words} {1.0e3 * error:+.1f} m{self.unit}"


# Scales of encoder and times: no gear slips, clocks keep far better time. Clock: a frame at 200
# frames/s. Pose: a bracket set by steel rule, tape measure and spirit level, see `PoseBelief`.
# Focal length: six views of a board, see docs/vision.md. Diameters: a caliper; a cable flattens,
# its jacket varies. Bands are painted by hand.
NUMBERS = (
    Number("encoder_scale", 5.0e-4, "the encoder's angles are"),
    Number("frame_times", 5.0e-4, "the times of the frames are"),
    Number("camera_clock", 5.0e-3, "the camera's clock is ahead of the encoder's by", "s", 0.5),
    Number("encoder_zero", 0.02, "the encoder's zero is wrong by", "rad", 0.5),
    Number("camera_tilt_x", 0.01, "the camera's tilt about x is wrong by", "rad"),
    Number("camera_tilt_y", 0.01, "the camera's tilt about y is wrong by", "rad"),
    Number("camera_roll", 5.0e-3, "the camera's roll is wrong by", "rad"),
    Number("camera_distance", 7.0e-4, "the camera's distance is wrong by", "m", 0.1),
    Number("camera_height", 2.0e-3, "the camera's height is wrong by", "m", 0.1),
    Number("camera_along", 2.0e-3, "the camera's place along the axis is wrong by", "m", 0.1),
    Number("focal_length", 1.0e-3, "the focal length is set"),
    Number("cylinder_diameter", 1.0e-3, "the cylinder diameter is set"),
    Number("cable_diameter", 0.01, "the cable diameter is set", most=0.5),
    Number("band_width", 0.04, "the band width is set", most=0.6),
)
COUNT = len(NUMBERS)
SCALE, TIMES, CLOCK, ZERO, TILT = range(5)
PLACE = TILT + 3
FOCAL, CYLINDER, CABLE, BAND = range(PLACE + 3, COUNT)
