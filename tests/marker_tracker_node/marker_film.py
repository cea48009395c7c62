"""Filmed winding runs, the rig's renderer before the tracker under test, and what tests share."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from marker_tracker_node import CameraPose, PinholeCamera, Tracker, TrackerConfig
from winding_core.cable.cases import Case
from winding_core.helix import FleetAngleLaw
from winding_core.machine.drive import DriveProfile
from winding_core.machine.readings import AxisReading
from winding_core.markers import MarkerFlag, Markers
from winding_rig_node.camera import (
    CablePath,
    CameraConfig,
    Paint,
    Renderer,
    Scene,
    Surroundings,
    Window,
)
from winding_rig_node.lay.known_lay import CableLay
from winding_verification.tracker.scenes import pinhole

TURN = 2.0 * math.pi
FREE_LENGTH = 0.198
# The encoder's step, of 8192 in a turn [rad].
COUNT = TURN / 8192
DRIVE = DriveProfile()
UNSEEN = int(MarkerFlag.NOT_WOUND | MarkerFlag.PREDICTED)
FULL_VIEW = CameraConfig().full_frame(3)
# The part of the full 1920x1080 sensor, pixel by pixel, that the cable can reach.
FINE = Window(x_offset=240, y_offset=100, width=1000, height=880, binning=1)
SENSOR = replace(CameraConfig(), window=FINE)
GRID = np.arange(0.0, 42.0, 0.01)


def marked_lay(
    case: Case, z: np.ndarray, stretch: float = 1.0, slope: np.ndarray | None = None
) -> CableLay:
    """A cable that lies at z over GRID, its markers one stretched spacing apart along it."""
    slope = np.gradient(z, GRID) if slope is None else slope
    way = np.hypot(case.centreline_radius, slope)
    length = np.concatenate([[0.0], np.cumsum(0.005 * (way[1:] + way[:-1]))])
    marked = stretch * case.marker_spacing * np.arange(case.marker_count + 1)
    return CableLay(path_theta=GRID, path_z=z, marker_theta=np.interp(marked, length, GRID))


def smooth_lay(case: Case, stretch: float = 1.0) -> CableLay:
    """A cable that follows the fleet-angle law exactly, its markers one spacing apart."""
    law = FleetAngleLaw(
        advance_per_radian=DRIVE.advance_per_radian,
        free_length=FREE_LENGTH,
        radius=case.centreline_radius,
    )
    return marked_lay(case, law.z(GRID), stretch, law.slope(GRID))


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def photograph(name: str) -> np.ndarray:
    datasets = pytest.importorskip("sklearn.datasets")
    return datasets.load_sample_image(name)[..., ::-1].copy()


def encoder(angle: float) -> float:
    """The nearest count of the encoder, as an angle."""
    return round(angle / COUNT) * COUNT


def axes(angle: float, guide: float) -> AxisReading:
    """What the machine reports of itself where only its positions count."""
    return AxisReading(
        cylinder_angle=angle, angular_speed=0.0, carriage_position=guide, feed_speed=0.0
    )


@dataclass
class Film:
    """Frames of a run with their ground truth.

    Attributes:
        surroundings: What stands around the cylinder.
    """

    case: Case  # What is wound
    lay: CableLay  # Where the cable lies; the paper's measured lay unless another is given
    camera: CameraConfig = field(default_factory=CameraConfig)  # That films
    seed: int = 1  # Of the sensor noise
    surroundings: Surroundings = field(default_factory=Surroundings)
    paint: Paint = field(default_factory=Paint)  # Colours of the scene
    dot_size: float = 0.0  # Of the dots that the markers are [m]; 0 for ring bands

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

    def frame_at(self, angle: float, guide: float | None = None) -> np.ndarray:
        guide = angle * DRIVE.advance_per_radian if guide is None else guide
        return self.renderer.render(self.scene(angle, guide), self.rng)

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
            yield t, self.frame_at(angle, guide), encoder(angle), guide

    def followed(
        self,
        fps: float,
        tracker: Tracker | None = None,
        change: Callable[[np.ndarray, float], np.ndarray] | None = None,
        read: Callable[[float, float], float] | None = None,
        **when: float,
    ) -> tuple[Tracker, np.ndarray, np.ndarray]:
        """Track the frames of `frames`; return the tracker, its records and the encoder's angles.

        Args:
            fps: Frames a second [1/s].
            tracker: A new one unless another is given.
            change: Makes the picture that is seen of the one drawn, and of the angle [rad].
            read: Makes the reading of the encoder of time [s] and angle [rad].
            when: See `frames`.
        """
        tracker, records, angles = tracker or self.tracker(), [], []
        for t, drawn, angle, guide in self.frames(fps, **when):
            frame = drawn if change is None else change(drawn, angle)
            reading = angle if read is None else read(t, angle)
            records.append(tracker.track(frame, t, reading, guide))
            angles.append(angle)
        assert records
        return tracker, np.stack(records), np.array(angles)

    def pinhole(self) -> PinholeCamera:
        return pinhole(self.camera)

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


# Films a case of the paper; further arguments are fields of the film.
FilmMaker = Callable[..., Film]
Frames = list[tuple[float, np.ndarray]]


@dataclass(frozen=True, kw_only=True)
class Wrong:
    """Numbers that a tracker is given wrongly."""

    number: str = ""  # That has to be named
    share: float = math.nan  # By how much it is set too large; nan where no share is given
    tilt: tuple[float, float, float] = (0.0, 0.0, 0.0)  # Of the camera, by so much [rad]
    away: float = 0.0  # The camera's distance [m]
    focal: float = 1.0  # Factor on the focal length
    reading: float = 1.0  # Factor on the encoder's angles
    times: float = 1.0  # Factor on the frames' times
    config: dict[str, float] = field(default_factory=dict)  # Factors on fields
    # Makes the picture that is seen of one drawn at a time [s].
    picture: Callable[[np.ndarray, float], np.ndarray] = lambda frame, t: frame

    def followed(
        self, film: Film, frames: Frames, *, explain: bool = False
    ) -> tuple[Tracker, list[Markers]]:
        """Track pictures of a film; return the tracker, and what was published.

        Args:
            film: That was filmed.
            frames: Its times [s] and pictures.
            explain: Whether what was seen is explained as it comes, and not in the end alone.
        """
        config = film.tracker().config
        x, y, z = config.pose.position
        tilt = tuple(np.add(config.pose.tilt, self.tilt).tolist())
        fields = {name: factor * getattr(config, name) for name, factor in self.config.items()}
        config = replace(
            config, pose=CameraPose(position=(x + self.away, y, z), tilt=tilt), **fields
        )
        tracker, published = Tracker(config, pinhole(film.camera, self.focal)), []
        for t, frame in frames:
            # The encoder keeps its own time: a wrong one asks it for another instant.
            angle, guide = DRIVE.positions(self.times * t)
            reading = self.reading * encoder(angle)
            published.append(tracker.track(self.picture(frame, t), self.times * t, reading, guide))
            if explain:
                tracker.explain()
        return tracker, published


def dark_where(hidden: Callable[[float], bool]) -> Callable[[np.ndarray, float], np.ndarray]:
    """A change of pictures: black at the angles of which a function is true."""
    return lambda frame, angle: np.full_like(frame, 40) if hidden(angle) else frame
