"""Filmed runs whose truth is known, drawn from a seed, and numbers configured wrongly."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node import CameraPose, PinholeCamera, TrackerConfig
from winding_core.cable.cases import paper_case
from winding_core.helix import FleetAngleLaw
from winding_core.machine.drive import DriveProfile
from winding_core.units import MILLIMETRE, MILLIRADIAN, MILLISECOND
from winding_rig_node.camera import CablePath, CameraConfig, Light, Renderer, Scene, SensorNoise

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]

_STEP = 0.01
_GRID = np.arange(0.0, 45.0, _STEP)
_TURN = round(2.0 * math.pi / _STEP)
# Wound angle in which cable that lies beside its first turn has bent aside [rad].
_BENT = 2.0
_COUNT = 2.0 * math.pi / 8192


def pinhole(camera: CameraConfig, focal: float = 1.0) -> PinholeCamera:
    """Return the tracker's camera of the rig's, its focal length times a factor."""
    return PinholeCamera(**vars(replace(camera, focal=focal * camera.focal).calibration()))


@dataclass(frozen=True, kw_only=True)
class World:
    """A run as it really is."""

    cylinder_radius: float  # [m]
    cable_radius: float  # [m]
    marker_spacing: float  # [m]
    stretch: float  # Deformed over undeformed length
    marker_count: int  # After P0
    drive: DriveProfile  # Of cylinder and guide
    rest: float  # Time at which the machine starts [s]
    free_length: float  # [m]
    camera: CameraConfig  # That films
    landing: float = 0.0  # How far beyond P0 the guide stands as P0 lands [m]
    fps: float = 30.0  # Of the camera [1/s]
    duration: float = 18.0  # [s]

    @classmethod
    def drawn(cls, seed: int) -> World:
        """Return a run of a paper case, its sizes, light and noise drawn at random."""
        rng = np.random.default_rng(seed)
        case = paper_case(int(rng.integers(1, 13)))
        tail = bool(rng.integers(0, 2))
        return cls(
            cylinder_radius=case.cylinder_radius * float(rng.uniform(0.9, 1.1)),
            cable_radius=case.cable_radius * float(rng.uniform(0.9, 1.1)),
            marker_spacing=case.marker_spacing,
            stretch=float(rng.uniform(1.0, 1.06)),
            marker_count=case.marker_count,
            drive=DriveProfile(angular_speed=float(rng.uniform(1.4, 2.0))),
            rest=0.6 if tail else -2.0 * float(rng.uniform(0.4, 1.0)),
            free_length=float(rng.uniform(0.17, 0.22)),
            camera=replace(
                CameraConfig(),
                noise=SensorNoise(read=float(rng.uniform(0.0, 5.0))),
                light=Light(
                    gain=float(rng.uniform(0.7, 1.4)), highlight=float(rng.uniform(0.0, 0.3))
                ),
            ),
        )

    @property
    def radius(self) -> float:
        """R + r [m]."""
        return self.cylinder_radius + self.cable_radius

    @cached_property
    def _lay(self) -> tuple[FloatArray, FloatArray]:
        """Height [m] and slope [m/rad] of the cable over the grid of wound angles.

        Cable that the guide would lay into its first turn is held off by that, and bent before it.
        """
        law = FleetAngleLaw(
            advance_per_radian=self.drive.advance_per_radian,
            free_length=self.free_length,
            radius=self.radius,
        )
        lag = self.free_length / self.radius
        late = np.exp(-_GRID / lag)
        z = law.z(_GRID) + self.landing * (1.0 - late)
        slope = law.slope(_GRID) + self.landing / lag * late
        if z.min() < -self.cable_radius:
            # Back from so far behind P0 a guide leads the cable over itself.
            return z, slope
        rise = 1.0 - np.exp(-_GRID / _BENT)
        lack = 2.0 * self.cable_radius - (z[_TURN:] - z[:-_TURN])
        beside = max(float((lack / (rise[_TURN:] - rise[:-_TURN]))[:_TURN].max()), 0.0)
        return z + beside * rise, slope + beside * (1.0 - rise) / _BENT

    @property
    def markers(self) -> tuple[FloatArray, FloatArray]:
        """Wound angles [rad] and heights [m], shape (markers,)."""
        z, slope = self._lay
        way = np.hypot(self.radius, slope)
        length = np.concatenate([[0.0], np.cumsum(0.005 * (way[1:] + way[:-1]))])
        marked = self.stretch * self.marker_spacing * np.arange(self.marker_count + 1)
        theta = np.interp(marked, length, _GRID)
        return theta, np.interp(theta, _GRID, z)

    @property
    def times(self) -> FloatArray:
        """Of the frames [s], shape (frames,)."""
        return np.arange(0.0, self.duration, 1.0 / self.fps)

    def position(self, t: float) -> tuple[float, float]:
        """Return cylinder angle [rad] and guide position [m] at a time [s]."""
        angle, guide = self.drive.positions(t - self.rest)
        return float(angle), float(guide)

    def encoder(self, t: float) -> float:
        """Return the nearest count of the encoder at a time [s], as an angle [rad]."""
        return round(self.position(t)[0] / _COUNT) * _COUNT

    def frames(self, seed: int) -> list[ByteArray]:
        """Return the pictures at `times`."""
        rng = np.random.default_rng(seed)
        renderer = Renderer(self.camera)
        path = CablePath(theta=_GRID, z=self._lay[0])
        found = []
        for t in self.times.tolist():
            angle, guide = self.position(t)
            scene = Scene(
                cylinder_radius=self.cylinder_radius,
                cable_radius=self.cable_radius,
                cylinder_angle=angle,
                path=path,
                marker_theta=self.markers[0],
                guide_z=guide + self.landing,
                free_length=self.free_length,
            )
            found.append(renderer.render(scene, rng))
        return found

    def config(self) -> TrackerConfig:
        """Return the right configuration."""
        return TrackerConfig(
            cylinder_radius=self.cylinder_radius,
            cable_radius=self.cable_radius,
            marker_spacing=self.marker_spacing,
            marker_count=self.marker_count,
            expected_stretch=self.stretch,
            pose=CameraPose(position=self.camera.position),
            advance_per_radian=self.drive.advance_per_radian,
            free_length=self.free_length,
        )

    def pinhole(self, focal: float = 1.0) -> PinholeCamera:
        """Return the tracker's camera, its focal length times a factor."""
        return pinhole(self.camera, focal)


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
