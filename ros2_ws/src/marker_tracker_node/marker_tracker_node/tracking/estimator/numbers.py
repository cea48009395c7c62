"""The configured numbers that are estimated, and how well each is known before the run."""

from __future__ import annotations

from dataclasses import dataclass

from winding_core.units import MILLIMETRE, MILLIRADIAN, MILLISECOND


@dataclass(frozen=True, kw_only=True)
class Number:
    """A configured number.

    Attributes:
        doubt: One standard deviation of what is configured, in its unit.
        most: Largest error that is believed; an estimate there is unknown.
        unit: Of doubt and error: 1 for a relative one, or an SI unit as a number.
        symbol: Of the unit in sentences.
    """

    name: str
    doubt: float
    most: float
    words: str  # What it is in sentences
    unit: float = 1.0
    symbol: str = ""

    @property
    def relative(self) -> bool:
        """Whether errors are shares."""
        return not self.symbol

    def sentence(self, error: float) -> str:
        """Return by how much the number is wrong, in words.

        Args:
            error: What is set too large, relative or in SI.
        """
        way = "large" if error > 0.0 else "small"
        if self.relative:
            return f"{self.words} {abs(error):.1%} too {way}"
        if self.name == "camera_clock":
            way = "ahead of" if error > 0.0 else "behind"
            return f"{self.words} {abs(error) / self.unit:.0f} {self.symbol} {way} the encoder's"
        return f"{self.words} wrong by {error / self.unit:+.1f} {self.symbol}"


# Scales of encoder and times: no wheel slips that is right, clocks keep 0.1 %. Pose: a bracket set
# by tape measure and spirit level, as `PoseBelief`. Focal length: six views of a board give 0.1 %,
# see docs/vision.md. Diameters: a caliper; a cable flattens and its jacket varies. Bands: painted
# by hand.
NUMBERS = (
    Number(name="encoder_scale", doubt=5.0e-4, most=0.3, words="the encoder's angles are"),
    Number(name="frame_times", doubt=5.0e-4, most=0.3, words="the times of the frames are"),
    Number(
        name="camera_clock", doubt=5.0e-3, most=0.5, words="the camera's clock is",
        unit=MILLISECOND, symbol="ms",
    ),
    Number(
        name="encoder_zero", doubt=0.02, most=0.5, words="the encoder's zero is",
        unit=MILLIRADIAN, symbol="mrad",
    ),
    Number(
        name="camera_tilt_x", doubt=0.01, most=0.3, words="the camera's tilt about x is",
        unit=MILLIRADIAN, symbol="mrad",
    ),
    Number(
        name="camera_tilt_y", doubt=0.01, most=0.3, words="the camera's tilt about y is",
        unit=MILLIRADIAN, symbol="mrad",
    ),
    Number(
        name="camera_roll", doubt=0.005, most=0.3, words="the camera's roll is",
        unit=MILLIRADIAN, symbol="mrad",
    ),
    Number(
        name="camera_distance", doubt=7.0e-4, most=0.1, words="the camera's distance is",
        unit=MILLIMETRE, symbol="mm",
    ),
    Number(
        name="camera_height", doubt=2.0e-3, most=0.1, words="the camera's height is",
        unit=MILLIMETRE, symbol="mm",
    ),
    Number(
        name="camera_along", doubt=2.0e-3, most=0.1, words="the camera's place along the axis is",
        unit=MILLIMETRE, symbol="mm",
    ),
    Number(name="focal_length", doubt=1.0e-3, most=0.3, words="the focal length is set"),
    Number(name="cylinder_diameter", doubt=1.0e-3, most=0.3, words="the cylinder diameter is set"),
    Number(name="cable_diameter", doubt=0.01, most=0.5, words="the cable diameter is set"),
    Number(name="band_width", doubt=0.04, most=0.6, words="the band width is set"),
)  # fmt: skip
NAMES = tuple(number.name for number in NUMBERS)
SCALE, TIMES, CLOCK, ZERO = range(4)
TILT, PLACE = 4, 7
FOCAL, CYLINDER, CABLE, BAND = range(10, 14)
COUNT = len(NUMBERS)
