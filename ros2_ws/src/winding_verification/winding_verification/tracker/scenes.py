"""Filmed runs whose truth is known, drawn at random from a seed."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node import CameraPose, PinholeCamera, TrackerConfig
from winding_core.cable.cases import paper_case
from winding_core.helix import FleetAngleLaw
from winding_core.machine.drive import DriveProfile
from winding_rig_node.camera import CablePath, CameraConfig, Light, Renderer, Scene, SensorNoise

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]

_GRID = np.arange(0.0, 45.0, 0.01)
_COUNT = 2.0 * math.pi / 8192


def pinhole(camera: CameraConfig, focal: float = 1.0) -> PinholeCamera:
    """Return the tracker's camera of the rig's, its focal length times a factor."""
    info = camera.calibration()
    k = np.array(info.k, dtype=float).reshape(3, 3)
    k[[0, 1], [0, 1]] *= focal
    return PinholeCamera(
        width=info.width,
        height=info.height,
        k=k,
        d=info.d,
        roi=info.roi,
        binning=info.binning,
        distortion_model=info.distortion_model,
    )


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

    @property
    def _lay(self) -> tuple[FloatArray, FloatArray]:
        """Height [m] and slope [m/rad] of the cable over the grid of wound angles."""
        law = FleetAngleLaw(
            advance_per_radian=self.drive.advance_per_radian,
            free_length=self.free_length,
            radius=self.radius,
        )
        lag = self.free_length / self.radius
        late = np.exp(-_GRID / lag)
        return law.z(_GRID) + self.landing * (1.0 - late), law.slope(
            _GRID
        ) + self.landing / lag * late

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
