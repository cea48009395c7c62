"""Numbers that a tracker may be configured with wrongly, and what counts as naming them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from marker_tracker_node import CameraPose, TrackerConfig
from winding_core.units import MILLIMETRE, MILLIRADIAN, MILLISECOND

# Three sizes of each: relative, or in the unit beside it.
_SIZES = {
    "encoder_scale": (0.005, 0.02, 0.06),
    "frame_times": (0.005, 0.02, 0.06),
    "camera_clock": (30.0 * MILLISECOND, 100.0 * MILLISECOND, 240.0 * MILLISECOND),
    "camera_distance": (4.0 * MILLIMETRE, 10.0 * MILLIMETRE, 25.0 * MILLIMETRE),
    "camera_height": (3.0 * MILLIMETRE, 8.0 * MILLIMETRE, 20.0 * MILLIMETRE),
    "camera_along": (3.0 * MILLIMETRE, 8.0 * MILLIMETRE, 20.0 * MILLIMETRE),
    "camera_tilt_x": (8.0 * MILLIRADIAN, 20.0 * MILLIRADIAN, 40.0 * MILLIRADIAN),
    "camera_tilt_y": (8.0 * MILLIRADIAN, 20.0 * MILLIRADIAN, 40.0 * MILLIRADIAN),
    "camera_roll": (10.0 * MILLIRADIAN, 25.0 * MILLIRADIAN, 60.0 * MILLIRADIAN),
    "focal_length": (0.01, 0.03, 0.08),
    "cylinder_diameter": (0.01, 0.03, 0.08),
    "cable_diameter": (0.08, 0.15, 0.3),
    "band_width": (0.12, 0.25, 0.45),
    "marker_spacing": (0.3, 0.5, 1.0),
    "guide_offset": (4.0 * MILLIMETRE, 9.0 * MILLIMETRE, 20.0 * MILLIMETRE),
    "guide_scale": (0.15, 0.5, 1.0),
}
NUMBERS = tuple(_SIZES)
# The camera's place along one of its axes and its turn about the other show the same picture.
_SAME = {
    "camera_height": {"camera_tilt_x", "encoder_zero"},
    "camera_tilt_x": {"camera_height", "encoder_zero"},
    "camera_along": {"camera_tilt_y"},
    "camera_tilt_y": {"camera_along"},
}
# Words of remarks, warnings and doubts that name a number outside of the contradictions.
_WORDS = {
    "camera_clock": ("the camera's clock is",),
    "camera_height": ("set camera_tilt",),
    "camera_along": ("set camera_tilt",),
    "camera_tilt_x": ("set camera_tilt",),
    "camera_tilt_y": ("set camera_tilt",),
    "camera_distance": ("or the camera's distance",),
    "guide_offset": ("the guide's readings",),
    "guide_scale": ("the guide's readings",),
    "marker_spacing": ("the marker spacing",),
}


@dataclass(frozen=True, kw_only=True)
class WrongNumber:
    """One number that is set wrongly."""

    number: str  # Empty for none
    size: float  # By how much too large, relative or [m], [rad], [s]

    @property
    def words(self) -> tuple[str, ...]:
        """What names it in sentences."""
        return _WORDS.get(self.number, ())

    @property
    def names(self) -> set[str]:
        """Numbers whose naming explains the same pictures."""
        return {self.number} | _SAME.get(self.number, set())

    def config(self, right: TrackerConfig) -> TrackerConfig:
        """Return the configuration with this number wrong."""
        factor = 1.0 + self.size
        if self.number == "cylinder_diameter":
            return replace(right, cylinder_radius=factor * right.cylinder_radius)
        if self.number == "cable_diameter":
            return replace(right, cable_radius=factor * right.cable_radius)
        if self.number == "band_width":
            return replace(right, band_width=factor * right.band_width)
        if self.number == "marker_spacing":
            spacing = factor if self.size > 0.0 else 1.0 / (1.0 - self.size)
            return replace(right, marker_spacing=spacing * right.marker_spacing)
        if not self.number.startswith("camera") or self.number == "camera_clock":
            return right
        position, tilt = np.array(right.pose.position), np.array(right.pose.tilt)
        places = ("camera_distance", "camera_height", "camera_along")
        turns = ("camera_tilt_x", "camera_tilt_y", "camera_roll")
        if self.number in places:
            position[places.index(self.number)] += self.size
        else:
            tilt[turns.index(self.number)] += self.size
        x, y, z = position.tolist()
        a, b, c = tilt.tolist()
        return replace(right, pose=CameraPose(position=(x, y, z), tilt=(a, b, c)))

    @property
    def focal(self) -> float:
        """Factor on the focal length."""
        return 1.0 + self.size if self.number == "focal_length" else 1.0

    def reading(self, angle: float) -> float:
        """Return what the encoder reports [rad] of a true angle."""
        return angle * (1.0 + self.size) if self.number == "encoder_scale" else angle

    def guide(self, place: float) -> float:
        """Return what the guide reports [m] where it stands so far from where it began."""
        if self.number == "guide_scale":
            return place * (1.0 + self.size)
        return place

    def landing(self) -> float:
        """How far the guide's zero lies from where P0 lands [m]."""
        return self.size if self.number == "guide_offset" else 0.0

    def stamp(self, t: float) -> float:
        """Return the stamp of a frame of a true time [s]."""
        if self.number == "frame_times":
            return t * (1.0 + self.size)
        return t + self.size if self.number == "camera_clock" else t


def every_number(seed: int) -> Iterator[WrongNumber]:
    """Yield every number once, with a size and a sign drawn from a seed."""
    rng = np.random.default_rng(seed)
    for number, sizes in _SIZES.items():
        size = float(rng.choice(sizes)) * float(rng.choice([-1.0, 1.0]))
        yield WrongNumber(number=number, size=size)


RIGHT = WrongNumber(number="", size=math.nan)
