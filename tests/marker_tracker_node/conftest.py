"""A filmed winding run: the rig's renderer before the tracker under test."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

from marker_tracker_node import CameraPose, PinholeCamera, Tracker, TrackerConfig
from winding_core.cases import Case, paper_case
from winding_core.drive import DriveProfile
from winding_core.fleet_angle import FleetAngleLaw
from winding_rig_node.camera import CablePath, CameraConfig, Paint, Renderer, Scene, Surroundings
from winding_rig_node.lay.known_lay import CableLay, published_lay

# Modules beside the tests are imported by name.
sys.path.insert(0, str(Path(__file__).parent))

FREE_LENGTH = 0.198
COUNTS = 8192
DRIVE = DriveProfile()


def smooth_lay(case: Case, stretch: float = 1.0) -> CableLay:
    """A cable that follows the fleet-angle law exactly, its markers one spacing apart."""
    law = FleetAngleLaw(
        advance_per_radian=DRIVE.advance_per_radian,
        free_length=FREE_LENGTH,
        radius=case.centreline_radius,
    )
    grid = np.arange(0.0, 42.0, 0.01)
    way = np.hypot(case.centreline_radius, law.slope(grid))
    length = np.concatenate([[0.0], np.cumsum(0.5 * (way[1:] + way[:-1]) * 0.01)])
    marked = stretch * case.marker_spacing * np.arange(case.marker_count + 1)
    return CableLay(
        path_theta=grid, path_z=law.z(grid), marker_theta=np.interp(marked, length, grid)
    )


@dataclass
class Film:
    """Frames of a run with their ground truth.

    Attributes:
        case: What is wound.
        lay: Where the cable lies; the paper's measured lay unless another is given.
        camera: That films.
        seed: Of the sensor noise.
        surroundings: What stands around the cylinder.
        paint: Colours of the scene.
        dot_size: Of the dots that the markers are [m]; 0 for ring bands.
    """

    case: Case
    lay: CableLay
    camera: CameraConfig = field(default_factory=CameraConfig)
    seed: int = 1
    surroundings: Surroundings = field(default_factory=Surroundings)
    paint: Paint = field(default_factory=Paint)
    dot_size: float = 0.0

    def __post_init__(self) -> None:
        self.renderer = Renderer(self.camera, self.surroundings)
        self.rng = np.random.default_rng(self.seed)
        self.path = CablePath(theta=self.lay.path_theta, z=self.lay.path_z)
        known = ~np.isnan(self.lay.marker_theta)
        self.theta = self.lay.marker_theta
        self.z = np.full(self.theta.shape, np.nan)
        self.z[known] = self.path.height(self.theta[known])
        self.s = np.hypot(self.case.centreline_radius * self.theta, self.z)

    def scene(self, angle: float, guide_z: float, **changes: object) -> Scene:
        scene = Scene(
            cylinder_radius=self.case.cylinder_radius,
            cable_radius=self.case.cable_radius,
            cylinder_angle=angle,
            path=self.path,
            marker_theta=self.theta,
            guide_z=guide_z,
            free_length=FREE_LENGTH,
            paint=self.paint,
            dot_size=self.dot_size,
        )
        return replace(scene, **changes) if changes else scene

    def frame_at(self, angle: float) -> np.ndarray:
        return self.renderer.render(self.scene(angle, angle * DRIVE.advance_per_radian), self.rng)

    def frames(
        self, fps: float, start: float = 0.0, stop: float = 20.0, missing: float = 0.0
    ) -> Iterator[tuple[float, np.ndarray, float, float]]:
        """Yield time, frame, encoder reading and guide position; leave a share out at random."""
        dice = np.random.default_rng(3)
        for k in range(math.ceil(start * fps), math.ceil(stop * fps)):
            if dice.random() < missing:
                continue
            t = k / fps
            angle, guide = DRIVE.positions(t)
            frame = self.renderer.render(self.scene(angle, guide), self.rng)
            yield t, frame, encoder(angle), guide

    def pinhole(self) -> PinholeCamera:
        info = self.camera.calibration()
        return PinholeCamera.from_info(
            width=info.width,
            height=info.height,
            k=info.k,
            d=info.d,
            roi=info.roi,
            binning=info.binning,
            distortion_model=info.distortion_model,
        )

    def tracker(self, motion_before: np.ndarray | None = None, **changes: object) -> Tracker:
        config = TrackerConfig(
            cylinder_radius=self.case.cylinder_radius,
            cable_radius=self.case.cable_radius,
            marker_spacing=self.case.marker_spacing,
            marker_count=self.case.marker_count,
            expected_stretch=1.0 + self.case.nominal_stress / self.case.material.young,
            pose=CameraPose(position=self.camera.position),
            dot_size=self.dot_size,
        )
        config = replace(config, **changes)  # type: ignore[arg-type]
        return Tracker(config, self.pinhole(), motion_before=motion_before)


def encoder(angle: float) -> float:
    """The nearest count of the encoder, as an angle."""
    step = 2.0 * math.pi / COUNTS
    return round(angle / step) * step


@pytest.fixture(scope="session")
def paper_film():
    """A function that films a case of the paper as it was measured."""

    def film(number: int, **changes: object) -> Film:
        case = paper_case(number)
        lay = published_lay(case, DRIVE, FREE_LENGTH, DRIVE.positions(20.0)[0])
        return Film(case=case, lay=lay, **changes)  # type: ignore[arg-type]

    return film


@pytest.fixture(scope="session")
def smooth_film():
    """A function that films a cable on the fleet-angle law."""

    def film(number: int, stretch: float = 1.0, **changes: object) -> Film:
        case = paper_case(number)
        return Film(case=case, lay=smooth_lay(case, stretch), **changes)  # type: ignore[arg-type]

    return film


@pytest.fixture(scope="session")
def any_film():
    """The class of films, for a cable and a camera of a test's own."""
    return Film
