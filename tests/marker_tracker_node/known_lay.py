"""Lays whose every place is known, as the rig's renderer draws them."""

import math
from dataclasses import dataclass, field

import numpy as np
from marker_film import FREE_LENGTH, TURN, pinhole

from marker_tracker_node import CameraPose, LayConfig, LayReading, LayTracker
from marker_tracker_node.lay.report import defects_of, lay_records
from marker_tracker_node.lay.turn_map import BEFORE, PLACE_ANGLE, TurnMap
from winding_rig_node.camera import CablePath, CameraConfig, Renderer, Scene

SMALL = CameraConfig()
STEP = TURN / 720


def ramp(u):
    u = np.clip(u, 0.0, 1.0)
    return u * u * (3.0 - 2.0 * u)


@dataclass
class KnownLay:
    """A lay whose every place is known; turns that come over others lie on them."""

    radius: float
    cable: float
    pitch: float
    turns: int = 4
    changes: list = field(default_factory=list)

    def __post_init__(self):
        self.theta = np.arange(-1.0, self.turns * TURN + 1.0, STEP)
        self.z = self.pitch / TURN * self.theta
        for change in self.changes:
            self.z = self.z + change(self.theta)
        d, n = 2.0 * self.cable, round(TURN / STEP)
        self.lift = np.zeros_like(self.z)
        for i in range(n, self.z.size):
            below = np.arange(i - n, -1, -n)
            apart = np.minimum(np.abs(self.z[i] - self.z[below]), d)
            on = self.lift[below] + np.sqrt(d * d - apart * apart)
            self.lift[i] = np.where(apart < 0.98 * d, on, 0.0).max()
        # The guide does not follow what the cable does within a turn.
        weight = np.hanning(n) / np.hanning(n).sum()
        even = np.pad(self.z, n, mode="reflect", reflect_type="odd")
        even = np.convolve(even, weight, "same")[n:-n]
        self.guide = even + np.gradient(even, self.theta) * FREE_LENGTH / self.rho

    @property
    def rho(self):
        return self.radius + self.cable

    def config(self, camera, **changes):
        known = {
            "cylinder_radius": self.radius,
            "cable_radius": self.cable,
            "advance_per_radian": self.pitch / TURN,
            "free_length": FREE_LENGTH,
            "pose": CameraPose(position=camera.position),
        }
        return LayConfig(**{**known, **changes})

    def frames(self, camera, angles, seed):
        renderer, rng = Renderer(camera), np.random.default_rng(seed)
        path = CablePath(theta=self.theta, z=self.z, lift=self.lift)
        for angle in angles:
            guide = float(np.interp(angle, self.theta, self.guide))
            scene = Scene(
                cylinder_radius=self.radius,
                cable_radius=self.cable,
                cylinder_angle=angle,
                path=path,
                marker_theta=np.array([0.0, 5.0, 9.0]),
                guide_z=guide,
                free_length=FREE_LENGTH,
            )
            reading = LayReading(cylinder_angle=angle, guide_z=guide)
            yield renderer.render(scene, rng), reading

    def measured(self, camera=SMALL, step=0.08, seed=1, until=None, **changes):
        """Film the winding and return the tracker and its spans against the truth."""
        tracker = LayTracker(self.config(camera, **changes), pinhole(camera))
        spans, before = [], None
        for frame, reading in self.frames(
            camera, np.arange(0.0, until or self.turns * TURN, step), seed
        ):
            tracker.take(frame, reading)
            if tracker.span is not before and tracker.span is not None:
                lands = np.interp(reading.cylinder_angle, self.theta, self.z)
                spans.append(
                    tracker.span.angle - math.atan((reading.guide_z - lands) / FREE_LENGTH)
                )
            before = tracker.span
        return tracker, np.array(spans)

    def errors(self, records):
        """Return errors of z [m] of what lies on the cylinder itself, the cut end of P0 aside."""
        flat = np.interp(records["theta"], self.theta, self.lift) < 0.1 * self.cable
        used = records[flat & (records["theta"] > 0.05)]
        return used["z"] - np.interp(used["theta"], self.theta, self.z), used["sigma_z"]

    def defects(self):
        """Return the defects that the tracker's own limits find in the true z."""
        known = TurnMap()
        for place in range(int((self.theta[-1] + math.pi) / TURN * 72)):
            theta = (place - BEFORE + 0.5) * PLACE_ANGLE
            if theta > self.theta[0]:
                known.add(
                    theta,
                    float(np.interp(theta, self.theta, self.z)),
                    slope=0.0,
                    sigma=1e-6,
                    floor=0.0,
                    whole=True,
                    steep=0.0,
                )
        return list(defects_of(lay_records(self.config(SMALL), known, 0.0)))
